"""run_case.py NAME PART: calls a function of a case, `run` or `after_reboot`.

Exit status 0: it holds; 77: it cannot be tried here; otherwise the last line says what failed.
"""

import importlib
import sys
import traceback

sys.path[:0] = ["/share/guest", "/share/cases"]

from vm.basics import Skip  # noqa: E402


def main():
    name, part = sys.argv[1:]
    try:
        getattr(importlib.import_module(name), part)()
    except Skip as skip:
        print(skip)
        sys.exit(77)
    except Exception as failure:  # whatever it is, the last line tells it
        traceback.print_exc(file=sys.stdout)
        print(f"{type(failure).__name__}: {failure}" if not str(failure) else str(failure).replace("\n", " | "))
        sys.exit(1)


main()
