# SPDX-License-Identifier: Apache-2.0
"""`python -m tilegrad.selftest ...`: the program's self-test, `tilegrad selftest ...`."""

import sys

from tilegrad.__main__ import main

if __name__ == "__main__":
    sys.argv.insert(1, "selftest")
    main()
