# SPDX-License-Identifier: Apache-2.0
"""What `pip install .` and `./run wheel` call (PEP 517): CMake builds, the standard library packs.

A wheel holds the package, the program, its manual pages and completions. In the environment:

TILEGRAD_CMAKE_ARGS     more arguments for CMake, "-DTILEGRAD_PROGRAM=OFF" for the renderer alone:
                        without files, networks, program and the command `tilegrad`
TILEGRAD_BUILD          an existing build tree to use instead of build/pip
TILEGRAD_BUNDLE=1       puts the shared libraries into the wheel, too, with their licences: it then
                        runs where they are not installed. Wants patchelf.
"""

import base64
import hashlib
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile

SOURCE = pathlib.Path(__file__).resolve().parent.parent
VERSION = re.search(r'#define TILEGRAD_VERSION "([^"]+)"',
                    (SOURCE / "include/tilegrad/version.h").read_text()).group(1)
NAME = f"tilegrad-{VERSION}"
SDIST = ("CMakeLists.txt", "CMakePresets.json", "LICENSE", "CHANGELOG.md", "README.md",
         "pyproject.toml", "cmake", "configs", "data", "include", "python", "src")
# Part of every Debian; anything older than these would not start the program anyway.
SYSTEM_LIBRARIES = re.compile(r"(linux-vdso|ld-linux.*|libc|libm|libdl|librt|libpthread|libgcc_s|"
                              r"libstdc\+\+)\.so")
METADATA = f"""\
Metadata-Version: 2.1
Name: tilegrad
Version: {VERSION}
Summary: SIMD, tile-based differentiable rasterizer for CPUs, and the training system around it
License: Apache-2.0
Requires-Python: >=3.9
Requires-Dist: numpy>=1.22
Description-Content-Type: text/markdown

"""


# ---- What pip calls.

# No prepare_metadata_for_build_wheel: whether there is a command is known when the wheel is built.

def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    with tempfile.TemporaryDirectory() as folder:
        stage = pathlib.Path(folder) / "wheel"
        stage.mkdir()
        tag = wheel_tag()
        stage_package(build(), stage)
        if os.environ.get("TILEGRAD_BUNDLE"):
            bundle_libraries(stage / "tilegrad")
        write_metadata(stage, tag)
        return pack_wheel(stage, pathlib.Path(wheel_directory) / f"{NAME}-{tag}.whl")


def build_sdist(sdist_directory, config_settings=None):
    archive = pathlib.Path(sdist_directory) / f"{NAME}.tar.gz"
    with tarfile.open(archive, "w:gz") as tar:
        for name in SDIST:
            tar.add(SOURCE / name, f"{NAME}/{name}",
                    filter=lambda entry: None if "__pycache__" in entry.name else entry)
        with tempfile.NamedTemporaryFile("w") as info:
            info.write(METADATA)
            info.flush()
            tar.add(info.name, f"{NAME}/PKG-INFO")
    return archive.name


# ---- Building.

def cmake(*arguments):
    subprocess.run(["cmake", *map(str, arguments)], check=True)


def build():
    """The build tree, up to date."""
    given = os.environ.get("TILEGRAD_BUILD")
    tree = pathlib.Path(given).resolve() if given else SOURCE / "build/pip"
    if not (tree / "CMakeCache.txt").exists():
        ninja = ["-G", "Ninja"] if shutil.which("ninja") else []
        cmake("-S", SOURCE, "-B", tree, *ninja, "-DCMAKE_BUILD_TYPE=Release",
              "-DTILEGRAD_TESTS=OFF", "-DTILEGRAD_BENCH=OFF",
              f"-DPython_EXECUTABLE={sys.executable}",
              *shlex.split(os.environ.get("TILEGRAD_CMAKE_ARGS", "")))
    cmake("--build", tree, "--parallel", os.cpu_count(), "--target", "tilegrad_wheel")
    return tree


def program_in(stage):
    return stage / "tilegrad/bin/tilegrad"


def stage_package(tree, stage):
    """The package and the program, as the tree installs them, and what the program says of itself."""
    cmake(f"-DBUILD={tree}", f"-DTO={stage}", "-P", SOURCE / "python/install_into.cmake")
    program = program_in(stage)
    if not program.exists():  # TILEGRAD_PROGRAM=OFF
        return
    share = stage / f"{NAME}.data/data/share"
    subprocess.run([program, "man", "--out", share / "man/man1"], check=True)
    for shell, path in (("bash", "bash-completion/completions/tilegrad"),
                        ("zsh", "zsh/site-functions/_tilegrad"),
                        ("fish", "fish/vendor_completions.d/tilegrad.fish")):
        (share / path).parent.mkdir(parents=True)
        (share / path).write_bytes(subprocess.run([program, "completion", shell], check=True,
                                                  stdout=subprocess.PIPE).stdout)


# ---- Shared libraries.

def libraries_of(file):
    """{name: path} of what the loader would load, but for those that are everywhere."""
    lines = subprocess.run(["ldd", file], check=True, capture_output=True, text=True).stdout
    found = re.findall(r"^\s*(\S+) => (/\S+)", lines, re.M)
    return {name: path for name, path in found if not SYSTEM_LIBRARIES.match(name)}


def bundle_libraries(package):
    binaries = [path for path in package.rglob("*") if path.suffix == ".so"]
    binaries += [path for path in (package / "bin").glob("*")]
    found = {}
    for binary in binaries:
        found.update(libraries_of(binary))
    folder = package / "lib"
    folder.mkdir()
    for name, path in found.items():
        shutil.copy(os.path.realpath(path), folder / name)
        copy_license(path, folder)
        os.chmod(folder / name, 0o755)
    for binary in binaries + [folder / name for name in found]:
        # Not RUNPATH, which counts for a file's own needs alone: libraries need libraries.
        place = os.path.relpath(folder, binary.parent)
        subprocess.run(["patchelf", "--force-rpath", "--set-rpath", f"$ORIGIN/{place}", binary],
                       check=True)


def copy_license(library, folder):
    """The copyright file of the Debian package that `library` belongs to."""
    names = {str(library), os.path.realpath(library)}
    names |= {name.replace("/usr/lib/", "/lib/", 1) for name in names}
    for name in sorted(names):
        done = subprocess.run(["dpkg-query", "-S", name], capture_output=True, text=True)
        if done.returncode == 0:
            package = done.stdout.split(":")[0]
            shutil.copy(f"/usr/share/doc/{package}/copyright", folder / f"{package}.copyright")
            return
    sys.exit(f"build_backend: no Debian package has {library}: its licence cannot be told")


# ---- Packing.

def wheel_tag():
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{re.sub('[-.]', '_', sysconfig.get_platform())}"


def write_metadata(folder, tag):
    info = folder / f"{NAME}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(METADATA + (SOURCE / "README.md").read_text())
    if program_in(folder).exists():
        (info / "entry_points.txt").write_text("[console_scripts]\n"
                                               "tilegrad = tilegrad.__main__:main\n")
    shutil.copy(SOURCE / "LICENSE", info)
    (info / "WHEEL").write_text("Wheel-Version: 1.0\nGenerator: tilegrad\n"
                                f"Root-Is-Purelib: false\nTag: {tag}\n")


def pack_wheel(stage, wheel):
    record = []
    wheel.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(path for path in stage.rglob("*") if path.is_file()):
            name = str(path.relative_to(stage))
            data = path.read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
            record.append(f"{name},sha256={digest},{len(data)}\n")
            archive.write(path, name)
        name = f"{NAME}.dist-info/RECORD"
        archive.writestr(name, "".join(record) + f"{name},,\n")
    return wheel.name


if __name__ == "__main__":
    print(pathlib.Path(sys.argv[1]) / build_wheel(sys.argv[1]))
