# SPDX-License-Identifier: Apache-2.0
"""Sheets of several runs (bench/rivals/sheet.py)."""

import argparse
import importlib.util
import sys
import types

import numpy as np

from file_samples import PROGRAM, FolderTest, dataset, run, run_program
from support import SOURCE
from tilegrad import files


def sheets() -> types.ModuleType:
    spec = importlib.util.spec_from_file_location("sheet", SOURCE / "bench/rivals/sheet.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["sheet"] = module  # dataclasses look for it
    spec.loader.exec_module(module)
    return module


class BenchSheets(FolderTest):
    def test_columns_stand_beside_each_other(self) -> None:
        sheet = sheets()
        layout = sheet.Layout(columns=4, before=(0,), own=(1, 2), after=(3,), gap=1)
        shared = np.zeros((2, 11, 3), np.uint8)  # columns of two pixels
        summaries = []
        for first in (10, 50):
            summary = shared.copy()
            for column in range(4):
                summary[:, 3 * column:3 * column + 2] = first + column
            summaries.append(summary)
        row = sheet.beside(summaries, layout)[0, :, 0].tolist()
        white = [255]
        self.assertEqual(row, [10] * 2 + 4 * white + [11] * 2 + white + [12] * 2 +
                         4 * white + [51] * 2 + white + [52] * 2 + 4 * white + [13] * 2)
        self.assertRaisesRegex(ValueError, "different objects", sheet.beside,
                               [summaries[0], summaries[0][:1]], layout)
        self.assertRaisesRegex(ValueError, "no 5 columns", sheet.cells, summaries[0],
                               sheet.Layout(5, (0,), (1,), (2,), 1))

    def test_of_runs(self) -> None:
        sheet = sheets()
        run_program("eval", "--run", run(), "--data", dataset())
        layout = sheet.Layout(columns=4, before=(0,), own=(1, 2), after=(3,), gap=4)
        options = argparse.Namespace(program=str(PROGRAM), data=str(dataset()),
                                     sheet=self.folder / "sheet.png")
        said = sheet.write(options, {"ours": run(), "theirs": run()}, layout)
        self.assertIn("ours, theirs", said)
        made, summary = files.load_image(options.sheet), files.load_image(run() / "summary.png")
        cell = (summary.shape[1] - 3 * 4) // 4
        self.assertEqual(made.shape[:2], (summary.shape[0], 6 * cell + 2 * 4 + 3 * 16))
        np.testing.assert_array_equal(made[:, :cell], summary[:, :cell, :3])
        np.testing.assert_array_equal(made[:, -cell:], summary[:, -cell:, :3])
