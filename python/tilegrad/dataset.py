# SPDX-License-Identifier: Apache-2.0
"""Datasets that `tilegrad dataset` renders, as arrays.

    data = Dataset("datasets/furniture", views=2)
    for batch in data.batches(64, steps=1000):
        batch["images"], batch["masks"], batch["cameras"]      # (64, 2, 3, H, W), ...

A Dataset has a length and items, so torch.utils.data.DataLoader accepts it directly.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, Iterator, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import name_of, Path, thread_count
from tilegrad._camera import Camera
from tilegrad._mesh import Mesh, mesh_of_dict

Item = dict[str, Any]

_SPLITS = ("train", "validation", "test")


@dataclasses.dataclass(frozen=True)
class ModelInfo:
    """Metadata of a model. source_faces: triangles of its original."""

    id: str
    name: str
    class_index: int
    split: str
    license: str
    creator: str
    source_faces: int


class Truth:
    """The ground truth of a model. occupancy: (32, 32, 32) bool as [x, y, z]; points: (2500, 3)
    float32 on the surface, largest half-extent 0.45; mesh: with colours, at most 5,000 faces. The
    last two are empty and None where the source has no meshes."""

    def __init__(self, occupancy: np.ndarray, points: np.ndarray, mesh: Optional[Mesh]) -> None:
        self.occupancy, self.points, self.mesh = occupancy, points, mesh


class Dataset:
    """The models of a split, in a fixed order.

    Item i is a dict of arrays: images (K, 3, H, W) float32, 0 to 1, RGB over black; masks (K, H, W)
    float32; cameras (K, 17) float32 (`Camera.of_numbers`); views (K,) int64, which of the model's
    views these are; class (int), of `classes`; split (int), of "train", "validation", "test"; model
    (int), of `models`.

    folder: of the dataset. split: "train", "validation", "test", or None for all models.
    views: K views of each item, distinct and at random, by seed, epoch (`set_epoch`) and item;
        None: all views in their order.
    seed: of every random choice, >= 0.
    in_memory: read all images now, as bytes, with `threads` threads (as in `tilegrad.Renderer`)
        instead of one file for each item.

    Can be pickled, and read from forked workers. Errors: OSError and ValueError name the file and
    the place in it; IndexError.
    """

    def __init__(self, folder: Path, split: Optional[str] = "train", views: Optional[int] = None,
                 seed: int = 0, *, in_memory: bool = False, threads: int = 0) -> None:
        if split is not None:
            _arrays.check_choice("Dataset", "split", split, _SPLITS)
        self._arguments = {"folder": name_of(folder), "split": split, "views": views,
                           "seed": seed, "in_memory": in_memory, "threads": threads}
        self._files = _tools.DatasetFiles(name_of(folder))
        self.info: dict[str, Any] = self._files.info
        self.models: list[ModelInfo] = [ModelInfo(**model) for model in self._files.models]
        self._indices = [i for i, model in enumerate(self.models) if split in (None, model.split)]
        self._views = self._checked_views(views)
        self._seed = _arrays.as_count("Dataset", "seed", seed)
        self._epoch = 0
        threads = thread_count("Dataset", threads)
        self._images = self._files.load_all_images(self._indices, threads) \
            if _arrays.as_flag("Dataset", "in_memory", in_memory) else None

    @property
    def classes(self) -> list[str]:
        """Names of classes, by their index."""
        return self.info["classes"]

    @property
    def image_size(self) -> int:
        """Pixels a side, H = W."""
        return self.info["image_size"]

    @property
    def cameras(self) -> Camera:
        """Of all views, the same for every model; if each has its own (items have those), typical
        ones."""
        return Camera.of_numbers(self._files.cameras, (self.image_size, self.image_size))

    def set_epoch(self, epoch: int) -> None:
        """Selects the epoch, >= 0, and with it the views of items. Workers of a DataLoader use the
        epoch set before they started."""
        self._epoch = _arrays.as_count("set_epoch", "epoch", epoch)

    def __len__(self) -> int:
        return len(self._indices)

    def __getitem__(self, index: int) -> Item:
        index = self._checked_index(index)
        shown = np.arange(self.info["views"])
        if self._views is not None:
            random = np.random.default_rng((self._seed, self._epoch, index))
            shown = random.permutation(shown)[:self._views]
        return self._item(index, shown)

    def __iter__(self) -> Iterator[Item]:
        return (self[i] for i in range(len(self)))

    def batches(self, size: int, *, steps: Optional[int] = None,
                first_step: int = 0) -> Iterator[Item]:
        """Batches of `size` items as `tilegrad train` sees them with this seed, from `first_step`
        on: every epoch shows each model once in a new order, and the last batch of an epoch runs
        into the next. Arrays get a leading axis; class, split and model become (size,) int64.

        A batch depends on (seed, step) only. steps: number of batches; None: endless.
        """
        size = _arrays.as_number("batches", "size", size, int)
        first = _arrays.as_number("batches", "first_step", first_step, int)
        if size < 1 or first < 0 or not len(self):
            raise ValueError(f"batches: size is {size}, first_step {first}, of {len(self)} models; "
                             f"expected size >= 1, first_step >= 0 and a model")
        if steps is None:
            return self._batches(size, itertools.count(first))
        end = first + _arrays.as_count("batches", "steps", steps)
        return self._batches(size, range(first, end))

    def truth(self, index: int) -> Truth:
        """Occupancy, surface points and mesh of item `index`."""
        data = self._files.load_truth(self._indices[self._checked_index(index)])
        mesh = data["mesh"]
        return Truth(data["occupancy"].astype(bool), data["points"],
                     None if mesh is None else mesh_of_dict(mesh))

    def _batches(self, size: int, steps: Any) -> Iterator[Item]:
        order = _tools.BatchOrder(len(self), self.info["views"], self._seed)
        for step in steps:
            models, shown = order.batch(step, size, self._views or self.info["views"])
            items = [self._item(int(index), views) for index, views in zip(models, shown)]
            yield {key: np.stack([item[key] for item in items]) for key in items[0]}

    def _item(self, index: int, shown: np.ndarray) -> Item:
        model = self._indices[index]
        images = self._files.load_images(model) if self._images is None else self._images[index]
        rgba = images[shown].astype(np.float32) / 255
        return {"images": rgba[:, :3], "masks": rgba[:, 3],
                "cameras": self._files.load_cameras(model)[shown].astype(np.float32),
                "views": shown.astype(np.int64), "class": self.models[model].class_index,
                "split": _SPLITS.index(self.models[model].split), "model": model}

    def _checked_index(self, index: int) -> int:
        """The index, counted from 0."""
        index = _arrays.as_number("Dataset", "item", index, int)
        if not -len(self) <= index < len(self):
            raise IndexError(f"Dataset: item {index} of {len(self)}")
        return index % len(self)

    def _checked_views(self, views: Optional[int]) -> Optional[int]:
        if views is None:
            return None
        count = int(_arrays.as_number("Dataset", "views", views, int))
        if not 1 <= count <= self.info["views"]:
            raise ValueError(f"Dataset: views is {count}, the dataset has {self.info['views']} of "
                             f"each model")
        return count

    def __getstate__(self) -> dict[str, Any]:
        return {"arguments": self._arguments, "epoch": self._epoch}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state["arguments"])  # type: ignore[misc]
        self._epoch = state["epoch"]

    def __repr__(self) -> str:
        return (f"<tilegrad Dataset: {len(self)} models of {self._arguments['folder']!r}, "
                f"{self.image_size} x {self.image_size} pixels>")
