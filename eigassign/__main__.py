"""``python -m eigassign``, and the ``eigassign`` command."""

from __future__ import annotations

import sys


def main() -> int:
    """Run the command line; Ctrl-C while it is still being imported ends it as later."""
    try:
        import gc

        gc.set_threshold(50_000)  # of 700, a run of two_link takes 7 % more processor time
        from eigassign.cli import main as run

        code = run()
    except BaseException as error:
        # before 3.12, Python makes a RuntimeError of an interrupt while a class is made
        if KeyboardInterrupt not in (type(error), type(error.__cause__)):
            raise
        sys.stderr.write("eigassign: interrupted\n")
        code = 130
    # CPython dies of SIGINT at its end, whatever the code, if an interrupt has passed through code
    # made from text, such as that of dataclasses; to run any such code makes it forget.
    exec("")
    return code


if __name__ == "__main__":  # worker processes import this module under another name
    sys.exit(main())
