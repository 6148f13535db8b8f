# SPDX-License-Identifier: Apache-2.0
"""Prints one table of the small files in shared/cases, which came from reports of users of other
programs: what is right for each, and what this program did.

    cases_table.py PROGRAM [FOLDER]

FOLDER: default $TILEGRAD_SHARED/cases, else shared/cases beside or above the source. Skips, and says
so, where it is absent. Exit code 1 if a file is not right.
"""

import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy as np

SIZE, HALF = 128, 4 * np.tan(np.radians(20))  # pixels; what they show at z = 0, seen from 4 away


class Shot:
    """What the program did with one file."""

    def __init__(self, program, folder, arguments):
        with tempfile.TemporaryDirectory() as out:
            file = pathlib.Path(out) / "a.npy"
            command = [program, "render", *map(str, arguments), "--size", str(SIZE), "--out", file]
            done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
            self.image = np.load(file) if file.exists() else None
        self.code, self.text = done.returncode, done.stderr.strip()
        self.refused = self.code in (2, 3)

    def at(self, x, y):
        """RGB bytes at a point of the plane z = 0."""
        column, row = (x / HALF + 1) / 2 * SIZE, (1 - y / HALF) / 2 * SIZE
        return np.rint(255 * self.image[int(row), int(column), :3])

    def mask(self):
        return self.image[..., 3] > 0.5


def straight(*more):
    return ("--shading", "none", "--eye", 0, 0, 4, "--supersample", 1, *more)


def drawn(shot):
    return shot.code == 0 and shot.mask().any()


def colored(points, tolerance=12):
    """points: {(x, y): (r, g, b)}"""
    def check(shot):
        return drawn(shot) and all(np.abs(shot.at(*point) - color).max() <= tolerance
                                   for point, color in points.items())
    return check


def said(*words):
    """Drawn, with a warning that has these words."""
    return lambda shot: drawn(shot) and all(word in shot.text for word in words)


def refused(*words):
    return lambda shot: shot.refused and all(word in shot.text for word in words)


def either(*checks):
    return lambda shot: any(check(shot) for check in checks)


def round_or_said(shot):
    mask = shot.mask() if shot.code == 0 else np.zeros((1, 1), bool)
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if len(rows) == 0:
        return shot.refused and shot.text != ""
    box = (rows[-1] - rows[0] + 1) * (columns[-1] - columns[0] + 1)
    return abs(mask.sum() / box - np.pi / 4) < 0.03 or "extent" in shot.text


def within(low, high):
    """The box of what is drawn, seen by `wide`."""
    def check(shot):
        if not drawn(shot):
            return False
        scale = 2 * 12 * np.tan(np.radians(20)) / SIZE
        rows, columns = np.flatnonzero(shot.mask().any(1)), np.flatnonzero(shot.mask().any(0))
        box = [2.25 + scale * (columns[0] - SIZE / 2), 2.25 + scale * (columns[-1] + 1 - SIZE / 2),
               2 - scale * (rows[-1] + 1 - SIZE / 2), 2 - scale * (rows[0] - SIZE / 2)]
        return np.abs(np.subtract(box, [low[0], high[0], low[1], high[1]])).max() < 2 * scale
    return check


CORNER = 0.93  # of a square from -1 to 1
LL, LR, UR, UL = (-CORNER, -CORNER), (CORNER, -CORNER), (CORNER, CORNER), (-CORNER, CORNER)
RED, GREEN, BLUE = (255, 0, 0), (0, 255, 0), (0, 0, 255)
WHITE = (255, 255, 255)

# File: (what is right, check). Arguments, where they are not those of `straight`, in VIEWS.
RIGHT = {
    "22_partial.obj": ("its colour each, others white",
                       colored({LL: WHITE, LR: BLUE, UL: (255, 128, 64)}, 90)),
    "12_specgloss_tex.glb": ("drawn with its texture", drawn),
    "11_EXT_texture_webp_used.glb": ("warned", said("EXT_texture_webp")),
    "11_KHR_texture_basisu_used.glb": ("warned", said("KHR_texture_basisu")),
    "33_webp_plain.glb": ("warned or refused", either(said("webp"), refused("webp"))),
    "13_skin.glb": ("x -0.5 to 0.5, y 1.5 to 2.5", within((-0.5, 1.5), (0.5, 2.5))),
    "22_vcolor.obj": ("corner (252, 0, 42)", colored({(-0.95, -0.95): (252, 0, 42)})),
    "34_twolibs.obj": ("(0, 0, 255)", colored({(0, 0): BLUE})),
    "34_missing.obj": ("warned", said("nothere.mtl")),
    "34_unknown.obj": ("warned", said("zzz")),
    "34_c_mtlbom.obj": ("(255, 0, 0)", colored({(0, 0): RED})),
    "34_c_objbom.obj": ("(255, 0, 0)", colored({(0, 0): RED})),
    "34_c_objbom_comment.obj": ("(255, 0, 0)", colored({(0, 0): RED})),
    "25_facecolor.ply": ("coloured", lambda s: drawn(s) and np.ptp(s.at(0.5, -0.5)) > 100),
    "27_off_vcolor.off": ("red, green, blue corners", colored({LL: RED, LR: GREEN, UR: BLUE}, 75)),
    "26_twotex.ply": ("lower right red, upper left blue",
                      colored({(0.5, -0.5): RED, (-0.5, 0.5): BLUE})),
    "22_vcolor255.obj": ("warned", said("colours")),
    "25_float255.ply": ("warned or drawn", drawn),
    "24_ascii_upper.stl": ("drawn or refused", either(drawn, refused("STL"))),
    "27_noff.off": ("drawn or refused", either(drawn, refused("line 1"))),
    "36_cmyk_noadobe.obj": ("warned: its image is not there", said("15_cmyk_noadobe.jpg")),
}
for name in ("EXT_meshopt_compression", "EXT_texture_webp", "KHR_draco_mesh_compression",
             "KHR_texture_basisu"):
    RIGHT[f"11_{name}_required.glb"] = ("refused", refused(name))
for name in ("30_utm_sphere.obj", "30_utm_sphere.ply", "30_local_sphere.obj"):
    RIGHT[name] = ("round, or warned with extent", round_or_said)
for name in ("30_huge.obj", "30_huge18.obj", "30_tiny.obj", "30_tiny20.obj", "30_utm.obj"):
    RIGHT[name] = ("drawn, warned or refused", either(drawn, lambda shot: shot.text != ""))
# The two squares of samename.glb, seen from three times as far: points are a third of what they were.
ASIDE = ("--shading", "none", "--eye", 1.5, 0, 12, "--target", 1.5, 0, 0, "--supersample", 1)

# File of second/: (what is right, check, arguments of the view).
SECOND = {
    "gltf_plus/plus.gltf": ("red", colored({(0, 0): RED}), straight()),
    "gltf_plus/encoded.gltf": ("red", colored({(0, 0): RED}), straight()),
    "gltf/same.obj": ("orange", colored({(0.5, -0.5): (255, 128, 0)}), straight()),
    "gltf/u8_not_normalized.glb": ("as same.obj, or refused",
                                   either(colored({(0.5, -0.5): (255, 128, 0)}), refused("COLOR")),
                                   straight()),
    "gltf/samename.glb": ("left blue, right red", colored({(-0.5, 0): BLUE, (0.5, 0): RED}), ASIDE),
    "stl/magics_all_default.stl": ("red", colored({(0.3, 0.3): RED, (0.8, 0.8): RED}), straight()),
    "threemf/colors.3mf": ("both colours, or warned",
                           either(colored({(0.7, 0.3): RED, (0.3, 0.7): GREEN}),
                                  said("colours of single triangles")), straight()),
    "ply/quality_nan.ply": ("read", drawn, straight()),
    "obj_no_usemtl/mesh.obj": ("warned", said("usemtl"), straight()),
}
CAMERAS = {"tf_fisheye.json": refused("the lens is distorted"),
           "tf_isfisheye.json": refused("the lens is distorted"),
           "tf_ortho.json": refused("EQUIRECTANGULAR"), "tf_k1.json": refused("k1"),
           "tf_blenderscale.json": refused("rotation"), "tf_mirror.json": refused("rotation"),
           "colmapf": refused("a.png: the lens is distorted")}
COUNTS = {"tf_anglexy.json": 1, "tf_perframe.json": 2, "colmap1": 3, "colmap2": 2}


def scaled_texture(program, folder, file, u, v):
    """Whether `file` looks like its square with texture coordinates u(0), u(1) and v(0), v(1)."""
    with tempfile.TemporaryDirectory() as place:
        mesh = pathlib.Path(place) / "square.obj"
        uvs = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])]
        shutil.copy(folder / "q.png", place)
        mesh.with_suffix(".mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd q.png\n")
        mesh.write_text("mtllib square.mtl\nusemtl m\n"
                        "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n" +
                        "".join(f"vt {s} {t}\n" for s, t in uvs) + "f 1/1 2/2 3/3 4/4\n")
        shot = Shot(program, folder, (file, *straight()))
        plain = Shot(program, folder, (mesh, *straight()))
    return shot, drawn(shot) and drawn(plain) and np.abs(shot.image - plain.image).max() < 8 / 255


def diffuse_of(file):
    data = file.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    material = json.loads(data[20:20 + length])["materials"][0]
    linear = np.array(material["extensions"]["KHR_materials_pbrSpecularGlossiness"]
                      ["diffuseFactor"][:3])
    return np.rint(255 * np.where(linear < 0.0031308, 12.92 * linear,
                                  1.055 * linear ** (1 / 2.4) - 0.055))


def count_views(program, folder, cameras):
    with tempfile.TemporaryDirectory() as out:
        done = subprocess.run([program, "render", "22_plain.ply", "--cameras", cameras, "--out", out],
                              capture_output=True, text=True, cwd=folder, check=False)
        return done, len(list(pathlib.Path(out).glob("*.png")))


def reads_display_window(file):
    """Whether Python reads six rows of eight pixels, zeros but for columns 4 to 6 of rows 1 and 2."""
    from tilegrad.images import load_layers  # not in every build
    data = [[y, x] for y in (1, 2) for x in (4, 5, 6)]
    return all(plane.shape == (6, 8) and np.argwhere(plane).tolist() == data
               for plane in load_layers(file).values())


class Fit:
    """What `tilegrad fit` made of a folder, or what it had said when it said `until`."""

    def __init__(self, program, folder, until=None):
        with tempfile.TemporaryDirectory() as place:
            out = pathlib.Path(place) / "fit"
            command = [program, "fit", folder, "--out", out, "--steps", "100", "--hold-out", "5",
                       "--json"]
            self.text = ""
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                  text=True) as fit:
                for line in fit.stderr:
                    self.text += line
                    if until and until in line:
                        fit.kill()
                        break
                result = fit.stdout.read()
                fit.wait()
                self.code = fit.returncode
            scores = json.loads(result).get("held_out") if self.code == 0 else None
            self.iou = scores["silhouette_iou"] if scores else 0.0
            self.extent = extent_of(out / "mesh.glb") if self.code == 0 else np.inf
        self.text, self.refused = self.text.strip(), self.code in (2, 3)


def extent_of(glb):
    """The largest coordinate of a GLB, whose accessors say what theirs are."""
    data = glb.read_bytes()
    accessors = json.loads(data[20:20 + int.from_bytes(data[12:16], "little")])["accessors"]
    return max(np.abs([a["min"], a["max"]]).max() for a in accessors
               if a["type"] == "VEC3" and "min" in a)


def fitted(*words, iou=0.93):
    """The sphere, whose largest coordinate is 0.7, rather than what looks like it from one side."""
    return lambda fit: (fit.iou > iou and fit.extent < 1
                        and all(word in fit.text for word in words))


# Folder of second/: (what is right, check, and after which words of it no more is asked).
SEARCH = "looking for cameras"
FITS = {
    "fit_base": ("the sphere", fitted()),
    "fit_cx0": ("the sphere: 0 is a number", fitted(iou=0.88)),  # half of it is in the pictures
    "fit_parallel": ("the sphere, or the cause", either(fitted(iou=0.88), refused("parallel"))),
    "fit_two_models": ("the larger one, and a word", fitted("sparse")),
    "fit_some_mask_paths": ("refused", refused("004.png")),
    "fit_one_without_alpha": ("refused", refused("003.png")),
    "fit_empty_mask": ("named; the others fitted", fitted("003.png", iou=0.91)),
    "fit_narrow": ("warned, no lens", fitted("degrees")),
    # Their cameras are searched for: what is said before that counts.
    "fit_webp": ("read", lambda fit: SEARCH in fit.text and "not read" not in fit.text, SEARCH),
    "fit_mixed_kinds": ("what is skipped is named",
                        lambda fit: all(kind in fit.text.lower() for kind in ("heic", "tif", "bmp")),
                        SEARCH),
}


def second_rows(program, folder):
    """As `rows`, of the files after further reports."""
    for name, (right, check, *until) in FITS.items():
        fit = Fit(program, folder / name, *until)
        yield f"second/{name}", right, check(fit), fit
    for name, (right, check, view) in SECOND.items():
        shot = Shot(program, folder, (name, *view))
        yield f"second/{name}", right, check(shot), shot
    shot = Shot(program, folder, ("../34_missing.obj", *straight("--texture", "png/red.png")))
    yield ("second/png/red.png", "red, or refused",
           colored({(0, 0): RED})(shot) or refused("red.png")(shot), shot)
    try:
        yield ("second/exr/crop.exr", "6 x 8 pixels, zeros around",
               reads_display_window(folder / "exr/crop.exr"), None)
    except ImportError:
        print("skipped: second/exr/crop.exr; Python has no module tilegrad")


def rows(program, folder):
    """(file, what is right, whether it is, the shot)."""
    for file in sorted(folder.glob("*.*")):
        name = file.name
        if name in ("20_s.obj", "20_o.obj"):
            u, v = ((0, 2), (0, 4)) if name == "20_s.obj" else ((0.25, 1.25), (0.5, 1.5))
            shot, good = scaled_texture(program, folder, name, u, v)
            yield name, "its texture coordinates", good, shot
        elif name == "12_specgloss_factor.glb":
            shot = Shot(program, folder, (name, *straight()))
            color = tuple(diffuse_of(file))
            yield name, f"colour {color}", colored({(0, 0): color})(shot), shot
        elif file.suffix in (".jpg", ".png", ".tga"):
            shot = Shot(program, folder, ("34_missing.obj", *straight("--texture", name)))
            yield name, "drawn or refused", drawn(shot) or refused(name)(shot), shot
        elif file.suffix in (".glb", ".gltf", ".obj", ".ply", ".off", ".stl"):
            right, check = RIGHT.get(name, ("drawn", drawn))
            view = straight()
            if name.startswith("30_"):
                view = ("--shading", "none", "--supersample", 1)
            elif name == "13_skin.glb":
                view = ("--shading", "none", "--eye", 2.25, 2, 12, "--target", 2.25, 2, 0)
            elif right == "drawn" and not name.startswith("2"):
                view = ("--shading", "none")
            shot = Shot(program, folder, (name, *view))
            yield name, right, check(shot), shot
    for name, check in CAMERAS.items():
        shot = Shot(program, folder, ("22_plain.ply", "--cameras", name))
        yield name, "refused", check(shot), shot
    for name, count in COUNTS.items():
        done, views = count_views(program, folder, name)
        yield name, f"{count} cameras", done.returncode == 0 and views == count, done
    if (folder / "second").is_dir():
        yield from second_rows(program, folder / "second")
    else:
        print(f"skipped: there is no folder {folder}/second")


def find_folder():
    root = pathlib.Path(__file__).resolve().parents[2]
    places = [root / "../shared", root / "../../shared"]
    if "TILEGRAD_SHARED" in os.environ:
        places.insert(0, pathlib.Path(os.environ["TILEGRAD_SHARED"]))
    return next((p.resolve() / "cases" for p in places if (p / "cases").is_dir()), None)


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    folder = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else find_folder()
    if folder is None:
        print("SKIPPED: there is no folder shared/cases")
        return 0
    wrong = 0
    print("| file | right is | got | said |\n|---|---|---|---|")
    for name, right, good, shot in rows(program, folder):
        text = getattr(shot, "text", "").splitlines()
        got = "refused" if getattr(shot, "refused", False) else "warned" if text else "drawn"
        got = got if good else "WRONG"
        wrong += not good
        print(f"| {name} | {right} | {got} | {text[0][:110] if text else ''} |")
    print(f"{wrong} wrong" if wrong else "all right")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
