# ruff: noqa: E501  (a table)
"""Mistakes in targets, design entries and the assignment: each told once, at its place."""

from pathlib import Path

import pytest
from mistakes import problems_of
from small_case import TEXT, edited, unmarked

T = "  - {mode: 1, frequency: 190 Hz}\n"
D = "  d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}\n"
ROD = "parameter: sections.rod.diameter"
ONE = "sections.rod.diameter: 2 cm"

# fmt: off
TARGETS = {
    "two kinds": ("{mode: 1, frequency: 1, ¦at_least: 3}", "at_least", "frequency is given already: write a target of its own"),
    "no kind": ("¦{mode: 1}", "", "expected one of the keys frequency, at_least, at_most, keep_out, gap, stiffness, compliance, sag; got mode"),
    "misspelt kind": ("{mode: 1, ¦frequncy: 3}", "frequncy", "did you mean 'frequency'?"),
    "stiffness of nothing": ("{stiffness: {¦at: hand.tip, direction: [1, 0]}, at_least: 3}", "stiffness.at", "expected 'hand.start' or 'hand.end', got 'hand.tip'"),
    "stiffness nowhere": ("{¦stiffness: {at: hand.end}, at_least: 3}", "stiffness.direction", "required key is missing"),
    "stiffness to no side": ("{stiffness: {at: hand.end, ¦direction: [0, 0]}, at_least: 3}", "stiffness.direction", "has no direction: all components are zero"),
    "stiffness out of the plane": ("{stiffness: {at: hand.end, ¦direction: [0, 0, 1]}, at_least: 3}", "stiffness.direction", "planar: needs 2 components (x, y), got 3"),
    "stiffness at most": ("{stiffness: {at: hand.end, direction: [0, 1]}, ¦at_most: 3}", "at_most", "a stiffness has the limit at_least"),
    "stiffness of any amount": ("¦{stiffness: {at: hand.end, direction: [0, 1]}}", "at_least", "required key is missing: stiffness (in N/m"),
    "stiffness in N": ("{stiffness: {at: hand.end, direction: [0, 1]}, ¦at_least: 3 N}", "at_least", "which is force"),
    "compliance at least": ("{compliance: {at: hand.end, direction: [0, 1]}, ¦at_least: 3}", "at_least", "a compliance has the limit at_most"),
    "compliance as stiffness": ("{compliance: {at: hand.end, direction: [0, 1]}, ¦at_most: 3 N/um}", "at_most", "which is stiffness"),
    "sag without weight": ("{¦sag: {at: hand.end}, at_most: 1 mm}", "sag", "nothing sags without mechanism.gravity: [0, -9.81]"),
    "stiffness of a mode": ("{stiffness: {at: hand.end, direction: [0, 1]}, at_least: 3, ¦mode: 1}", "mode", "unknown key; allowed: weight"),
    "stiffness and gap": ("{gap: {between: [1, 2], at_least: 2}, ¦stiffness: {at: hand.end, direction: [0, 1]}}", "stiffness", "gap is given already"),
    "no mapping": ("¦7", "", "expected a mapping, got 7"),
    "no mode": ("¦{at_least: 3}", "mode", "the number of a mode (or modes: [...])"),
    "mode and modes": ("{mode: 1, ¦modes: [2], at_most: 3}", "modes", "mode is given already"),
    "frequency of all": ("{¦modes: all, frequency: 3}", "modes", "all modes cannot have one frequency"),
    "at most of all": ("{¦modes: all, at_most: 3}", "modes", "there is always a higher mode"),
    "misspelt all": ("{¦modes: al, at_least: 3}", "modes", "expected 'all', or a list, got 'al'"),
    "mode twice": ("{modes: [1, ¦1], at_least: 3}", "modes[1]", "mode 1 is listed twice"),
    "mode in words": ("{¦mode: first, at_least: 3}", "mode", "expected a whole number, got 'first'"),
    "limit in words": ("{mode: 1, ¦at_least: fast}", "at_least", "expected a frequency (in Hz"),
    "limit of zero": ("{mode: 1, ¦at_least: 0}", "at_least", "must be > 0 Hz"),
    "band downwards": ("{¦keep_out: [52, 48]}", "keep_out", "the band must go upwards, got [52, 48] Hz"),
    "band of nothing": ("{¦keep_out: [48, 48 Hz]}", "keep_out", "the band must go upwards"),
    "half a band": ("{¦keep_out: [48]}", "keep_out[1]", "entry 2 is missing"),
    "band of one number": ("{¦keep_out: 50 Hz}", "keep_out", "expected [low, high] or {harmonic"),
    "harmonic of nothing": ("{¦keep_out: {harmonic: 2, margin: 5 %}}", "keep_out.of", "required key is missing"),
    "margin of all": ("{keep_out: {harmonic: 2, of: 3, ¦margin: 100 %}}", "keep_out.margin", "must be < 1"),
    "margin in rpm": ("{keep_out: {harmonic: 2, of: 3, ¦margin: 30 rpm}}", "keep_out.margin", "expected a fraction (a plain number when bare; or %), got '30 rpm'"),
    "followed band": ("{keep_out: [1, 2], mode: {like: 1, at: {¦time: 3}}}", "mode.at.time", "3 s is outside"),
    "gap of no mode": ("{gap: {between: [1, ¦{like: 1}], at_least: 2}}", "gap.between[1].at", "required key is missing"),
    "gap of one shape": ("{gap: {¦between: [{like: 1, at: {time: 0}}, {like: 1, at: {time: 0}}], at_least: 2}}", "gap.between", "got the mode like mode 1 (t = 0 s) twice"),
    "gap in itself": ("{gap: {¦between: [1, 1], at_least: 2}}", "gap.between", "a gap is between two modes, got 1 twice"),
    "gap downwards": ("{gap: {¦between: [2, 1], at_least: 2}}", "gap.between", "the lower mode comes first: [1, 2]"),
    "gap of a mode": ("{gap: {between: [1, 2], at_least: 2}, ¦mode: 1}", "mode", "unknown key; allowed: weight"),
    "part backwards": ("{mode: 1, at_least: 3, ¦during: [1, 0]}", "during", "the first time must be before the last"),
    "part outside": ("{mode: 1, at_least: 3, ¦during: [2, 3]}", "during", "lies outside: the trajectory lasts from 0 to 1 s"),
    "profile of a part that ends early": ("{mode: 1, at_least: {¦time: [0, 0.5], frequency: [1, 2]}, during: [0.1, 0.6]}", "at_least.time", "covers 0 … 0.5 s only; the trajectory is wanted from 0.1 to 0.6 s"),
    "profile of a harmonic that ends early": ("{keep_out: {harmonic: 2, of: {¦time: [0, 0.5], frequency: [1, 2]}, margin: 1 %}}", "keep_out.of.time", "the trajectory lasts from 0 to 1 s"),
    "no such file": ("{mode: 1, at_least: {¦file: no.csv}}", "at_least.file", "no such file"),
    "unknown trajectory": ("{mode: 1, at_least: 3, ¦trajectory: pick}", "trajectory", "unknown trajectory 'pick'; known: 1"),
    "two frequencies of a mode in a list": ("{mode: 2, frequency: 3}\n  - {modes: [1, ¦2], frequency: 3}", "modes[1]", "mode 2 has a target already"),
    "followed from nowhere": ("{¦mode: {like: 1}, frequency: 3}", "mode.at", "required key is missing"),
    "followed from no pose": ("{mode: {like: 1, ¦at: {}}, frequency: 3}", "mode.at", "either time or q"),
    "followed from outside": ("{mode: {like: 1, at: {¦time: 3}}, frequency: 3}", "mode.at.time", "3 s is outside: the trajectory lasts from 0 to 1 s"),
    "followed on no trajectory": ("{mode: {like: 1, at: {time: 0, ¦trajectory: x}}, frequency: 3}", "mode.at.trajectory", "unknown trajectory 'x'"),
    "followed from half a pose": ("{mode: {like: 1, at: {¦q: [1]}}, frequency: 3}", "mode.at.q", "needs 2 entries, one for each coordinate (q1, q2); got 1"),
    "followed at no design": ("{mode: {like: 1, at: {time: 0}, design: {¦x: 3}}, frequency: 3}", "mode.design.x", "unknown design parameter 'x'; known: m, d"),
    "followed at a design in kg": ("{mode: {like: 1, at: {time: 0}, design: {¦d: 3 kg}}, frequency: 3}", "mode.design.d", "which is mass"),
}
ENTRIES = {
    "no values": (f"d: {{{ROD}, ¦values: []}}", "d.values", "needs at least 1 entries"),
    "value twice": (f"d: {{{ROD}, values: [20 mm, ¦2 cm]}}", "d.values[1]", "0.02 (SI units) is listed twice"),
    "value in kg": (f"d: {{{ROD}, values: [20 mm, ¦2 kg]}}", "d.values[1]", "which is mass"),
    "value it cannot have": (f"d: {{{ROD}, values: [20 mm, ¦0]}}", "d.values[1]", "must be > 0 m"),
    "values and bounds": (f"d: {{{ROD}, values: [30 mm], ¦min: 1 mm}}", "d.min", "values are given, and leave nothing to limit"),
    "neither values nor bounds": (f"¦d: {{{ROD}}}", "d.min", "give min and max, or values"),
    "price without unit": (f"d: {{{ROD}, min: 2 cm, max: 4 cm, ¦price: 3 mm}}", "d.price", "expected an amount per unit, such as 3 / m"),
    "price of another unit": (f"d: {{{ROD}, min: 2 cm, max: 4 cm, ¦price: 3 / kg}}", "d.price", "which is mass"),
    "no tolerance": (f"d: {{{ROD}, min: 2 cm, max: 4 cm, ¦tolerance: 0}}", "d.tolerance", "must be > 0"),
    "tolerance in kg": (f"d: {{{ROD}, min: 2 cm, max: 4 cm, ¦tolerance: 2 g}}", "d.tolerance", "which is mass"),
    "tolerance of all": (f"d: {{{ROD}, min: 2 cm, max: 4 cm, ¦tolerance: 100 %}}", "d.tolerance", "must be below 100 %"),
    "no choice": ("b: {¦choices: {}}", "b.choices", "needs at least 1 entries"),
    "choices without names": ("b: {¦choices: [1]}", "b.choices", "expected a mapping"),
    "empty choice": (f"b: {{choices: {{x: {{{ONE}}}, ¦y: {{}}}}}}", "b.choices.y", "needs at least 1 entries"),
    "same choice": (f"b: {{choices: {{x: {{{ONE}}}, ¦y: {{{ONE}}}}}}}", "b.choices.y", "has the same values as 'x'"),
    "choice of less": (f"b: {{choices: {{x: {{{ONE}, links.fore.length: 1}}, ¦y: {{{ONE}}}}}}}", "b.choices.y", "choice 'x' sets links.fore.length too"),
    "choice of more": (f"b: {{choices: {{x: {{{ONE}}}, y: {{{ONE}, ¦links.fore.length: 1}}}}}}", "b.choices.y.links.fore.length", "choice 'x' does not set it"),
    "price of what is not set": (f"b: {{choices: {{x: {{{ONE}}}}}, price: {{¦links.fore.length: 1}}}}", "b.price.links.fore.length", "the choices do not set it"),
    "price of another unit, of a choice": (f"b: {{choices: {{x: {{{ONE}}}}}, price: {{¦sections.rod.diameter: 1 / kg}}}}", "b.price.sections.rod.diameter", "which is mass"),
    "tolerance of what is not set": (f"b: {{choices: {{x: {{{ONE}}}}}, tolerance: {{¦links.fore.length: 1 mm}}}}", "b.tolerance.links.fore.length", "the choices do not set it"),
    "tolerance of another unit, of a choice": (f"b: {{choices: {{x: {{{ONE}}}}}, tolerance: {{¦sections.rod.diameter: 1 g}}}}", "b.tolerance.sections.rod.diameter", "which is mass"),
    "choice of nothing": ("b: {choices: {x: {¦sections.rod.diametr: 3}}}", "b.choices.x.sections.rod.diametr", "did you mean 'diameter'"),
    "choice in kg": ("b: {choices: {x: {¦sections.rod.diameter: 3 kg}}}", "b.choices.x.sections.rod.diameter", "which is mass"),
    "choice of a parameter": ("b: {choices: {x: {¦bodies.tool.mass: 3 kg}}}", "b.choices.x.bodies.tool.mass", "is a design parameter already: 'm'"),
    "choices between which no section is": ("b: {¦choices: {x: {sections.pipe.outer_diameter: 20 mm, sections.pipe.thickness: 1 mm}, y: {sections.pipe.outer_diameter: 60 mm, sections.pipe.thickness: 15 mm}}}", "b.choices", "between these choices section 'pipe' cannot exist"),
    "mass without limits": ("¦mass: {}", "mass", "needs min, max or both"),
    "mass upside down": ("mass: {¦min: 3, max: 1}", "mass.min", "min 3 is above max 1"),
    "mass in m": ("mass: {¦max: 1 m}", "mass.max", "which is length"),
    "torque of nothing": ("torque: {¦q3: {max: 3}}", "torque.q3", "unknown coordinate 'q3'; known: q1, q2"),
    "torque in N": ("torque: {q1: {¦max: 3 N}}", "torque.q1.max", "which is force"),
    "torque below nothing": ("torque: {q1: {¦max: 0}}", "torque.q1.max", "must be > 0 N m"),
    "torque without max": ("torque: {¦q1: {}}", "torque.q1.max", "required key is missing"),
    "torque from below": ("torque: {q1: {max: 3, ¦min: 1}}", "torque.q1.min", "unknown key"),
    "parameter called torque": (f"¦torque: {{{ROD}, min: 2 cm, max: 4 cm}}", "torque", "'torque' limits what drives exert"),
}
ASSIGNMENT = {
    "misspelt method": ("{¦method: oneshot}", "method", "did you mean 'one_shot'"),
    "misspelt objective": ("{¦objective: worst}", "objective", "did you mean 'worst_case'"),
    "no start": ("{¦starts: 0}", "starts", "must be >= 1"),
    "too many starts": ("{¦starts: 1001}", "starts", "must be <= 1000"),
    "no step": ("{¦steps: 0}", "steps", "must be >= 1"),
    "no time": ("{¦seconds: 0}", "seconds", "must be > 0 s"),
    "no error": ("{¦max_error: 0 %}", "max_error", "must be > 0"),
    "unknown key": ("{¦step: 3}", "step", "did you mean 'steps'"),
    "worst case in one shot": ("{method: one_shot, ¦objective: worst_case}", "objective", "is not least_squares: method: one_shot takes only frequency targets"),
}
NOT_OF_OBJECTIVES = {
    "highest of nothing": ("{objective: {¦highest: none}}", T, "  - {mode: 1, at_least: 190 Hz}\n", "assignment.objective.highest", "expected a whole number, got 'none'"),
    "highest of the zeroth": ("{objective: {¦highest: 0}}", T, "  - {mode: 1, at_least: 190 Hz}\n", "assignment.objective.highest", "must be >= 1"),
    "highest without mode": ("{objective: {¦highest: {}}}", T, "  - {mode: 1, at_least: 190 Hz}\n", "assignment.objective.highest.mode", "required key is missing"),
    "lightest of something": ("{objective: {¦lightest: 1}}", T, "  - {mode: 1, at_least: 190 Hz}\n", "assignment.objective.lightest", "stands alone: write objective: lightest"),
    "highest nowhere": ("{objective: {highest: {mode: 1, ¦trajectory: go}}}", T, "  - {mode: 1, at_least: 190 Hz}\n", "assignment.objective.highest.trajectory", "go"),
    "frequency for the lightest": ("{objective: lightest}", T, "  - {mode: 1, ¦frequency: 190 Hz}\n", "targets[0].frequency", "objective lightest takes no wanted frequency: write at_least, at_most or both"),
    "frequency of the highest": ("{objective: {highest: 1}}", T, "  - {mode: 1, ¦frequency: 190 Hz}\n", "targets[0].frequency", "objective highest takes no wanted frequency"),
    "nothing to be wide": ("{¦objective: widest}", T, "  - {mode: 1, at_least: 190 Hz}\n", "assignment.objective", "widest needs a target with keep_out or gap"),
    "highest in one shot": ("{method: one_shot, ¦objective: {highest: 1}}", "targets:\n" + T, "", "assignment.objective", "write method: sequential"),
    "price in one shot": ("{method: one_shot}", D, "  ¦mass: {price: 3}\n", "design.mass", "prices the mass: method: one_shot"),
    "price of a length": ("{}", D, "  mass: {¦price: 3 / mm}\n", "design.mass.price", "mm"),
    "price in words": ("{}", D, "  mass: {¦price: dear}\n", "design.mass.price", "expected a number, got text 'dear'"),
    "price of nothing": ("{}", D, "  mass: {¦price: 0}\n", "design.mass.price", "must be > 0"),
    "mass without anything": ("{}", D, "  ¦mass: {}\n", "design.mass", "the mass needs min, max or both, or a price"),
}
NOT_IN_ONE_SHOT = {
    "limit": (T, "  - {mode: 1, ¦at_least: 3}\n", "targets[0].at_least"),
    "stiffness": (T, "  - {¦stiffness: {at: hand.end, direction: [0, 1]}, at_least: 3}\n", "targets[0].stiffness"),
    "followed mode": (T, "  - {¦mode: {like: 1, at: {time: 0}}, frequency: 3}\n", "targets[0].mode"),
    "mass": (D, "  ¦mass: {max: 3}\n", "design.mass"),
    "torque": (D, "  ¦torque: {q1: {max: 3}}\n", "design.torque"),
    "list": (D, f"  d: {{{ROD}, ¦values: [2 cm, 3 cm]}}\n", "design.d.values"),
}
# fmt: on


def check(marked: str, path: str, message: str, folder: Path) -> None:
    text, ((line, column),) = unmarked(marked)
    ((*place, found_path, found),) = problems_of(text, folder / "case.yaml")
    assert (place, found_path) == ([line, column], path)
    assert message in found


@pytest.mark.parametrize(("target", "key", "message"), TARGETS.values(), ids=TARGETS)
def test_a_wrong_target_is_told_once(target: str, key: str, message: str, tmp_path: Path) -> None:
    k = target[: target.index("¦")].count("\n")
    path = f"targets[{k}].{key}".removesuffix(".")
    check(edited(T, f"  - {target}\n"), path, message, tmp_path)


@pytest.mark.parametrize(("entry", "key", "message"), ENTRIES.values(), ids=ENTRIES)
def test_a_wrong_entry_of_the_design_is_told_once(
    entry: str, key: str, message: str, tmp_path: Path
) -> None:
    check(edited(D, f"  {entry}\n"), f"design.{key}", message, tmp_path)


@pytest.mark.parametrize(("keys", "key", "message"), ASSIGNMENT.values(), ids=ASSIGNMENT)
def test_a_wrong_assignment_is_told_once(keys: str, key: str, message: str, tmp_path: Path) -> None:
    check(TEXT + f"assignment: {keys}\n", f"assignment.{key}", message, tmp_path)


@pytest.mark.parametrize(("old", "new", "path"), NOT_IN_ONE_SHOT.values(), ids=NOT_IN_ONE_SHOT)
def test_one_shot_refuses_by_name_what_its_program_cannot_take(
    old: str, new: str, path: str, tmp_path: Path
) -> None:
    text = edited(old, new) + "assignment: {method: one_shot}\n"
    check(text, path, "write method: sequential", tmp_path)


@pytest.mark.parametrize(
    ("keys", "old", "new", "path", "message"), NOT_OF_OBJECTIVES.values(), ids=NOT_OF_OBJECTIVES
)
def test_objectives_and_prices_say_what_they_cannot_take(
    keys: str, old: str, new: str, path: str, message: str, tmp_path: Path
) -> None:
    check(edited(old, new or old) + f"assignment: {keys}\n", path, message, tmp_path)


def test_a_constraint_does_not_name_choices(tmp_path: Path) -> None:
    text = edited(D, f"  d: {{choices: {{x: {{{ONE}}}}}}}\n")
    text = text.replace("terms: {m: 1}", "terms: {m: 1, ¦d: 1}")
    message = "'d' is a list of choices; a constraint is between parameters"
    check(text, "design.constraints.budget.terms.d", message, tmp_path)


def test_a_followed_mode_is_named_at_one_of_the_choices(tmp_path: Path) -> None:
    target = "{mode: {like: 1, at: {time: 0}, design: {¦d: z}}, frequency: 3}"
    text = edited(D, f"  d: {{choices: {{x: {{{ONE}}}}}}}\n").replace(T, f"  - {target}\n")
    check(text, "targets[0].mode.design.d", "unknown choice 'z'; known: x", tmp_path)


def test_a_part_is_of_a_named_trajectory_where_there_are_several(tmp_path: Path) -> None:
    motion = TEXT[TEXT.index("trajectory:\n") : TEXT.index("design:\n")]
    several = "trajectory:\n" + 2 * "  - {q: [[0, 0], [1, 1]], duration: 1}\n"
    target = "  - {mode: 1, at_least: 3, ¦during: [0.1, 0.2]}\n"
    text = edited(motion, several).replace(T, target)
    check(
        text,
        "targets[0].during",
        "needs the trajectory that is meant, as trajectory (1, 2)",
        tmp_path,
    )
