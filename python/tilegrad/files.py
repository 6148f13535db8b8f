# SPDX-License-Identifier: Apache-2.0
"""Everything that tilegrad reads and writes.

    from tilegrad import files

    mesh = files.load_mesh("chair.glb")
    image = files.load_image("chair.png")
    mesh = files.Predictor("runs/demo").predict(image)
    data = files.Dataset("datasets/furniture", views=2)
"""

from tilegrad.cameras import View, load_cameras, rotation_from_vector, save_cameras
from tilegrad.dataset import Dataset, ModelInfo, Truth
from tilegrad.images import load_image, load_layers, save_image, save_layers
from tilegrad.meshes import (Material, Mesh, MeshCamera, MeshTables, MeshTexture, load_mesh,
                             mesh_endings, save_mesh)
from tilegrad.predict import Predictor
from tilegrad.weights import Checkpoint, Weights, load_checkpoint, load_weights, save_weights

__all__ = ["Checkpoint", "Dataset", "Material", "Mesh", "MeshCamera", "MeshTables", "MeshTexture",
           "ModelInfo", "Predictor", "Truth", "View", "Weights", "load_cameras", "load_checkpoint",
           "load_image", "load_layers", "load_mesh", "load_weights", "mesh_endings",
           "rotation_from_vector", "save_cameras", "save_image", "save_layers", "save_mesh",
           "save_weights"]
