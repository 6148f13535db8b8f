# SPDX-License-Identifier: Apache-2.0
"""Whether a file is whole, and which parts of a folder must be the same after kills as without."""
import json
import struct
import zipfile
import zlib


class Lost(Exception):
    """Something was lost, or half-written, or unclear."""


# ---- Whether a file is whole.

def check_png(data):
    at = 8
    while True:
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 4:at + 8 + length]
        if struct.unpack(">I", data[at + 8 + length:at + 12 + length])[0] != zlib.crc32(body):
            raise Lost("a chunk of a PNG is damaged")
        at += 12 + length
        if kind == b"IEND":
            return


def check_safetensors(data):
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    end = max([t["data_offsets"][1] for name, t in header.items() if name != "__metadata__"] or [0])
    if len(data) != 8 + size + end:
        raise Lost("a checkpoint is cut short")


def check_glb(data):
    if data[:4] != b"glTF" or struct.unpack("<I", data[8:12])[0] != len(data):
        raise Lost("a GLB is cut short")


def check_lines(data):
    for line in data.decode().split("\n")[:-1]:  # the last one may be cut: appended, not replaced
        json.loads(line)


def check_npz(path):
    with zipfile.ZipFile(path) as archive:
        if archive.testzip():
            raise Lost("an array is damaged")


def check_html(data):
    if b"</html>" not in data:
        raise Lost("a page is cut short")


def check_webp(data):
    if struct.unpack("<I", data[4:8])[0] + 8 != len(data):
        raise Lost("an animation is cut short")


CHECKS = {".png": check_png, ".safetensors": check_safetensors, ".glb": check_glb, ".html": check_html,
          ".json": lambda data: json.loads(data), ".jsonl": check_lines, ".webp": check_webp}


def check_folder(folder):
    """Everything that stands under its own name is whole."""
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        if path.name.endswith(".tmp"):
            continue
        try:
            if path.suffix == ".npz":
                check_npz(path)
            elif path.suffix in CHECKS:
                CHECKS[path.suffix](path.read_bytes())
        except Exception as error:
            raise Lost("%s: %s: %s" % (path, type(error).__name__, error)) from error


# ---- Results: what must be the same in the end.

def tensors_of(path):
    """The bytes of all tensors and their names; not the metadata, which holds seconds."""
    data = path.read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + size])
    header.pop("__metadata__", None)
    return sorted((name, t["shape"], data[8 + size + t["data_offsets"][0]:8 + size + t["data_offsets"][1]])
                  for name, t in header.items())


def newest_weights(folder):
    files = sorted((folder / "checkpoints").glob("step_*.safetensors"))
    if not files:
        raise Lost("%s has no checkpoint" % folder)
    return files[-1].name, tensors_of(files[-1])


def bytes_of(folder, patterns):
    """Contents by name."""
    files = sorted({p for pattern in patterns for p in folder.glob(pattern) if p.is_file()})
    if not files:
        raise Lost("%s has nothing like %s" % (folder, patterns))
    return {str(p.relative_to(folder)): p.read_bytes() for p in files}
