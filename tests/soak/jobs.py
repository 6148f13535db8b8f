# SPDX-License-Identifier: Apache-2.0
"""What is killed: commands on tiny data, the folders they write, and what of these must be the same in the end."""
import shutil

from whole import bytes_of, newest_weights

TINY = """name = "tiny"
[task]
kind = "%s"
[network]
%s
[schedule]
batch = 4
steps = %d
checkpoint_every = 2
log_every = 1
sample_every = 6
%s
"""
NETWORKS = {
    "single_image": "channels = 2\ncode = 8\nhidden1 = 8\nhidden2 = 8\ntemplate_level = 1",
    "textured_image": "base = 2\nmost = 4\nlevels = 2\nlatent = 6\nhidden = 5\nlight_width = 4\ntemplate_level = 1",
    "classify": "channels = 4\nmost = 8\nlevels = 2",
    "gan": "noise = 6\nshape_noise = 4\nhidden = 8\ntemplate_level = 1\ntexture_size = 32\ntexture_base = 2\ntexture_most = 4",
    "photographs": "base = 4\nmost = 8\nlevels = 2\nlatent = 12\ntemplate_level = 1",
}
STEPS = {"single_image": 30, "textured_image": 6, "classify": 30, "gan": 10, "photographs": 10}
MORE = {
    "gan": "[critic]\nbase = 2\nhalvings = 2\nupdates = 1\n[stages]\nshape = 5\n[textures]\ncount = 40\nrun = \"%s\"\n"
           "[score]\nevery = 4\ncount = 8\n[optimizer]\naverage = 0.5\n",
    "photographs": "[photographs]\nsize = 16\n",
}
BALL = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n"


class Job:
    """A command, the folder it writes, and what of it must be the same in the end."""

    def __init__(self, name, words, out, results, again=(), before=None):
        self.name, self.words, self.out = name, words, out
        self.results, self.again, self.before = results, list(again), before

    def prepare(self):
        """An empty place, or what the command begins with."""
        if self.out.exists():
            shutil.rmtree(self.out)
        if self.before:
            self.before(self.out)

    def next(self):
        """The command as it is given after a kill: one that wants to be told that it goes on, or may replace what is there,
        is told. A fit has to have begun; a training goes on with whatever there is."""
        begun = self.words[0] != "fit" or (self.out / "fit.txt").exists()
        return self.words + (self.again if begun else [])

    def at(self, folder):
        """The same command, writing somewhere else."""
        words = [str(w).replace(str(self.out), str(folder)) for w in self.words]
        return Job(self.name, words, folder, self.results, self.again, self.before)


def write_config(f, kind, steps):
    path = f / ("%s_%d.toml" % (kind, steps))
    more = MORE.get(kind, "")
    path.write_text(TINY % (kind, NETWORKS[kind], steps, more % (f / "textured") if "%s" in more else more))
    return path


def data_of(f, kind):
    return f / ("views" if kind == "photographs" else "data")


def prepare(soak):
    """What the commands read: a dataset, images around a shape, and trained networks."""
    f = soak.folder
    f.mkdir(parents=True, exist_ok=True)
    soak.must(["dataset", "--source", "procedural", "--per-class", "3", "--size", "16", "--views", "2", "--out", f / "data"])
    (f / "ball.obj").write_text(BALL)
    soak.must(["views", f / "ball.obj", "--views", "12", "--size", "24", "--out", f / "views"])
    for kind, name in (("textured_image", "textured"), ("single_image", "trained"), ("gan", "generator")):
        soak.must(["train", "--config", write_config(f, kind, 2), "--data", f / "data", "--out", f / name])
    soak.must(["dataset-view", "--data", f / "data", "--split", "test", "--out", f / "view.png"])


def jobs(f):
    data, run = f / "data", f / "trained"

    def copy_of_run(out):
        shutil.copytree(run, out)

    yield Job("dataset", ["dataset", "--source", "procedural", "--per-class", "3", "--size", "16", "--views", "2", "--out",
                          f / "dataset"], f / "dataset",
              lambda out: bytes_of(out, ["dataset.json", "models.jsonl", "models/*/*.npz", "contact_sheet.png"]))
    for kind in NETWORKS:
        out = f / ("run_" + kind)
        yield Job("train " + kind, ["train", "--config", write_config(f, kind, STEPS[kind]), "--data", data_of(f, kind), "--out",
                                    out], out, newest_weights, ["--resume"])
    yield Job("fit", ["fit", f / "views", "--out", f / "fit", "--steps", "20", "--checkpoint-every", "4", "--template-level", "2"],
              f / "fit", lambda out: bytes_of(out, ["*.glb"]), ["--resume"])
    yield Job("sample", ["sample", "--run", f / "generator", "--count", "2", "--interpolate", "2", "--out", f / "s"], f / "s",
              lambda out: bytes_of(out, ["*.glb", "*.png"]), ["--force"])
    yield Job("eval", ["eval", "--run", f / "e", "--data", data, "--views-per-model", "1"], f / "e",
              lambda out: bytes_of(out, ["eval.json", "eval.md"]), before=copy_of_run)
    yield Job("report", ["report", "--run", f / "r", "--data", data, "--models", "1"], f / "r",
              lambda out: bytes_of(out, ["summary.png"]), before=copy_of_run)
    yield Job("predict", ["predict", "--run", run, "--refine", "1", "--out", f / "p", f / "view.png"], f / "p",
              lambda out: bytes_of(out, ["*.glb", "*.png"]), ["--force"])
    yield Job("render", ["render", f / "ball.obj", "--size", "300", "--out", f / "d" / "drawn.png"], f / "d",
              lambda out: bytes_of(out, ["*.png"]), ["--force"])
