# SPDX-License-Identifier: Apache-2.0
"""`python -m tilegrad ...` and the command `tilegrad` of a wheel: the program of this package."""

import os
import pathlib
import shutil
import sys


def program() -> str:
    """The path of the program: that of this package, else the one on the PATH.
    FileNotFoundError: there is none."""
    own = pathlib.Path(__file__).parent / "bin/tilegrad"
    if own.exists():
        return str(own)
    # Not the script that leads here.
    found = shutil.which("tilegrad")
    if found and not pathlib.Path(found).read_bytes().startswith(b"#!"):
        return found
    raise FileNotFoundError("the program tilegrad is not installed: this package was built with "
                            "TILEGRAD_PROGRAM=OFF, or apart from it")


def main() -> None:
    try:
        path = program()
    except FileNotFoundError as error:
        sys.exit(f"tilegrad: {error}")
    os.execv(path, [path, *sys.argv[1:]])


if __name__ == "__main__":
    main()
