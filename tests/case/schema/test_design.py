"""What stands under `design` becomes one vector y, catalogues over its columns, and limits."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from json_schema_reader import reads_back
from small_case import TEXT, edited, read

from eigassign.case import CaseFile, Tolerance
from eigassign.errors import CaseError

D = "  d: {parameter: sections.rod.diameter, min: 20 mm, max: 40 mm}\n"
BOOM = """\
  boom:
    choices:
      light: {sections.bar.area: 4 cm2, sections.bar.bending_inertia: 2 cm4}
      heavy: {sections.bar.bending_inertia: 5 cm4, sections.bar.area: 6 cm2}
"""
LISTED = "  d: {parameter: sections.rod.diameter, values: [30 mm, 20 mm, 25 mm], price: 3 / mm}\n"


def with_entries(text: str) -> CaseFile:
    return read(edited(D, text))


def test_a_parameter_with_values_is_a_column_between_the_least_and_the_largest() -> None:
    design = with_entries(LISTED).design
    d = design.parameters["d"]
    assert (d.parameter, d.min, d.max, d.price) == ("sections.rod.diameter", 0.02, 0.03, 3000.0)
    (catalogue,) = design.catalogues
    assert (catalogue.name, catalogue.columns) == ("d", (1,))
    assert catalogue.choices == ("0.02", "0.025", "0.03")
    assert catalogue.rows == ((0.02,), (0.025,), (0.03,))


def test_choices_make_a_column_of_each_property_and_say_which_belong_together() -> None:
    case = with_entries(BOOM + LISTED)
    assert list(case.design.parameters) == ["m", "boom.area", "boom.bending_inertia", "d"]
    assert case.design_units == ("kg", "m2", "m4", "m")
    area = case.design.parameters["boom.area"]
    assert (area.parameter, area.min, area.max) == ("sections.bar.area", 4e-4, 6e-4)
    boom, d = case.design.catalogues
    assert (boom.name, boom.columns, d.columns) == ("boom", (1, 2), (3,))
    assert (boom.choices, boom.rows) == (("light", "heavy"), ((4e-4, 2e-8), (6e-4, 5e-8)))


def test_a_property_that_choices_set_has_a_price_for_each_unit_of_it() -> None:
    design = with_entries(BOOM + "    price: {sections.bar.area: 30 / cm2}\n").design
    assert design.parameters["boom.area"].price == pytest.approx(3e5, rel=1e-15)
    assert design.parameters["boom.bending_inertia"].price is None


def test_properties_that_end_alike_keep_their_whole_path() -> None:
    values = "{links.upper.length: 1, links.fore.length: %d, sections.rod.diameter: 2 cm}"
    case = with_entries(f"  arm: {{choices: {{a: {values % 1}, b: {values % 2}}}}}\n")
    assert list(case.design.parameters)[1:] == [
        "arm.links.upper.length",
        "arm.links.fore.length",
        "arm.diameter",
    ]


def test_the_expansion_point_has_an_entry_for_each_column() -> None:
    text = edited(D, BOOM).replace("order: 4", "order: 4, y: [100 g, 5 cm2, 3 cm4]")
    assert read(text).expansion.y == (0.1, 5e-4, 3e-8)


def test_the_mass_is_limited_beside_the_parameters() -> None:
    design = with_entries("  mass: {min: 500 g, max: 12}\n").design
    assert (design.mass.min, design.mass.max) == (0.5, 12.0)
    assert list(design.parameters) == ["m"]
    assert read(TEXT).design.mass is None


@pytest.mark.parametrize(
    ("written", "tolerance", "about_2"),
    [
        ("2 %", Tolerance(0.02, relative=True), 0.04),
        ("0.1 mm", Tolerance(1e-4, relative=False), 1e-4),
        ("0.5", Tolerance(0.5, relative=False), 0.5),
    ],
)
def test_a_tolerance_is_a_share_or_an_amount(
    written: str, tolerance: Tolerance, about_2: float
) -> None:
    case = with_entries(D.replace("}", f", tolerance: {written}}}"))
    assert case.design.parameters["d"].tolerance == tolerance
    assert tolerance.deviation(-2.0) == pytest.approx(about_2, rel=1e-15)


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-12, 0.999))
def test_a_share_is_written_so_that_the_same_number_is_read_back(share: float) -> None:
    written = Tolerance(share, relative=True).written()
    case = with_entries(D.replace("}", f", tolerance: {written}}}"))
    assert case.design.parameters["d"].tolerance == Tolerance(share, relative=True)


@pytest.mark.parametrize(
    ("path", "price", "value"),
    [
        ("bodies.tool.inertia", "3", 3.0),
        ("sections.rod.diameter", "3 / m", 3.0),
        ("sections.rod.diameter", "3/mm", 3000.0),
        ("sections.rod.diameter", "-0.5 / mm", -500.0),
        ("coordinates.q2.drive.stiffness", "1 / N m/rad", 1.0),
        *(
            ("sections.rod.diameter", wrong, None)
            for wrong in ("3 m", "m", "3 /", "3 g / m", "1e999 / m")
        ),
    ],
)
def test_a_price_is_for_one_si_unit(path: str, price: str, value: float | None) -> None:
    entry = f"  d: {{parameter: {path}, min: 0.02, max: 0.04, price: {price}}}\n"
    if value is None:
        with pytest.raises(CaseError, match=r"design\.d\.price"):
            with_entries(entry)
    else:
        found = with_entries(entry).design.parameters["d"].price
        assert found == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        BOOM + LISTED + "  mass: {max: 12 kg}\n",
        BOOM + "    price: {sections.bar.area: 30 / cm2}\n",
        D.replace("}", ", price: 3 / kg, tolerance: 2.5 %}").replace("/ kg", "/ cm"),
        D.replace("}", ", tolerance: 1 mm}"),
    ],
)
def test_every_entry_reads_back_equal_and_is_described_by_the_schema(text: str) -> None:
    reads_back(edited(D, text))


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        (BOOM, []),
        (LISTED.replace("30 mm, ", ""), []),
        (D.replace("40 mm", "25 mm"), ["initial value 30 mm of sections.rod.diameter is outside"]),
    ],
)
def test_the_start_may_lie_outside_bounds_and_lists_with_a_warning(
    text: str, messages: list[str]
) -> None:
    found = [str(warning) for warning in with_entries(text).warnings]
    assert len(found) == len(messages)
    assert all(message in warning for message, warning in zip(messages, found, strict=True))


# --- A price for each choice

PRICED = """\
  boom:
    choices:
      light: {sections.bar.area: 4 cm2, sections.bar.bending_inertia: 2 cm4, price: 12.5}
      heavy: {price: 20, sections.bar.bending_inertia: 5 cm4, sections.bar.area: 6 cm2}
"""


def test_choices_have_a_price_each_that_is_no_column_of_the_design() -> None:
    design = with_entries(PRICED).design
    assert list(design.parameters) == ["m", "boom.area", "boom.bending_inertia"]
    assert design.catalogues[0].prices == (12.5, 20.0)
    assert with_entries(BOOM).design.catalogues[0].prices == ()


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (", price: 12.5", "", "case.yaml:32:15: design.boom.choices.heavy.price: choice 'light'"),
        ("price: 20, ", "", "choices.heavy: choice 'light' sets price too, and all must set"),
        ("price: 20", "price: 20 kg", "heavy.price: expected a number without unit"),
        (":\n    c", ":\n    price: {sections.bar.area: 3}\n    c", "each choice has a price of"),
    ],
)
def test_prices_of_choices_that_make_no_sense_are_refused(
    old: str, new: str, expected: str
) -> None:
    with pytest.raises(CaseError) as error:
        with_entries(PRICED.replace(old, new))
    assert expected in str(error.value)


@pytest.mark.parametrize("shape", ["angle", "channel", "l_profile", "UPN80", "u_profile", "T"])
def test_sections_that_twist_under_their_load_are_refused_with_the_reason(shape: str) -> None:
    text = re.sub(r"bar: \{.*\}", f"bar: {{shape: {shape}, height: 60 mm}}", edited(D, D))
    with pytest.raises(CaseError, match=r"shear centre is not its centroid\).*type solid"):
        read(text)
