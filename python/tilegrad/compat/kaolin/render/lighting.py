# SPDX-License-Identifier: Apache-2.0
"""kaolin.render.lighting: spherical Gaussians, and spherical harmonics of degree up to 2,
orthonormal, with the Condon-Shortley sign, in the order 1 | y, z, x | xy, yz, 3z^2-1, xz, x^2-y^2.
"""

from __future__ import annotations

import math
from typing import Any, Optional, Sequence, Union

import torch

from tilegrad._dense import full_precision
from tilegrad.compat._tensors import check_floats
from tilegrad.compat.kaolin._missing import missing_from

__getattr__ = missing_from(__name__)
__all__ = ["project_onto_sh9", "sh9_diffuse", "sh9_irradiance", "SgLightingParameters",
           "approximate_sg_integral", "cosine_lobe_sg", "fresnel", "sg_diffuse_fitted",
           "sg_diffuse_inner_product", "sg_direction_from_azimuth_elevation",
           "sg_distribution_term", "sg_from_sun", "sg_irradiance_fitted",
           "sg_irradiance_inner_product", "sg_warp_distribution", "sg_warp_specular_term"]

# Clamped cosine, as factors of bands 0, 1, 2.
_COSINE = [math.pi] + 3 * [2 * math.pi / 3] + 5 * [math.pi / 4]


def project_onto_sh9(directions: Union[torch.Tensor, Sequence[float]]) -> torch.Tensor:
    """The nine basis functions. directions: [...,3], unit; or a list of 3 numbers. Returns [...,9].
    """
    if not isinstance(directions, torch.Tensor):
        directions = torch.tensor(directions, dtype=torch.get_default_dtype())
    check_floats("project_onto_sh9", "directions", directions,
                 (*directions.shape[:-1], 3))
    x, y, z = directions.unbind(dim=-1)
    return torch.stack([
        torch.full_like(x, 0.28209479177), -0.4886025119 * y, 0.4886025119 * z,
        -0.4886025119 * x, 1.0925484305920792 * x * y, -1.0925484305920792 * y * z,
        0.94617469575 * z * z - 0.31539156525, -1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y)], dim=-1)


@full_precision
def sh9_irradiance(lights: torch.Tensor, normals: torch.Tensor) -> torch.Tensor:
    """Irradiance from radiance with the coefficients lights [9], at points with normals [N,3].
    Returns [N]."""
    name = "sh9_irradiance"
    check_floats(name, "lights", lights, (9,))
    check_floats(name, "normals", normals, ("N", 3), like=lights)
    return project_onto_sh9(normals) @ (lights * lights.new_tensor(_COSINE))


@full_precision
def sh9_diffuse(directions: torch.Tensor, normals: torch.Tensor,
                albedo: torch.Tensor) -> torch.Tensor:
    """Light from directions [3] that a diffuse surface with normals [N,3] and albedo [N,3]
    reflects. Returns [N,3]."""
    check_floats("sh9_diffuse", "directions", directions, (3,))
    sizes: dict = {}
    check_floats("sh9_diffuse", "normals", normals, ("N", 3), sizes, directions)
    check_floats("sh9_diffuse", "albedo", albedo, ("N", 3), sizes, directions)
    return albedo * sh9_irradiance(project_onto_sh9(directions), normals).unsqueeze(-1)


_Gaussians = tuple[torch.Tensor, torch.Tensor, torch.Tensor]
_Values = Union[float, Sequence[float], torch.Tensor]


class SgLightingParameters:
    """Lights: amplitude [N,3], direction [N,3] made unit, sharpness [N]; a single one applies to
    all."""

    __slots__ = ("amplitude", "direction", "sharpness")

    def __init__(self, amplitude: _Values = 3., direction: Any = (1., 0., 0.),
                 sharpness: _Values = 5.) -> None:
        tensors = [torch.as_tensor(v, dtype=torch.float32) if not isinstance(v, torch.Tensor) else v
                   for v in (amplitude, direction, sharpness)]
        amplitude, direction, sharpness = (t.reshape(-1, *tail) if t.ndim else t for t, tail in zip(
            tensors, ((3,), (3,), ())))
        count = max(len(t) for t in (amplitude, direction, sharpness) if t.ndim)
        self.amplitude = amplitude.expand(count, 3)
        self.direction = torch.nn.functional.normalize(direction, dim=1).expand(count, 3)
        self.sharpness = sharpness.expand(count)

    @staticmethod
    def from_sun(direction: torch.Tensor, strength: _Values = 3., angle: _Values = math.pi / 4,
                 color: Optional[_Values] = None) -> SgLightingParameters:
        """As sg_from_sun; a number, and no colour, which is white, apply to all of direction [N,3]
        (or [3])."""
        direction = direction.reshape(-1, 3)
        strength, angle, color = (
            torch.as_tensor(v, dtype=direction.dtype).expand(len(direction), *tail)
            for v, tail in ((strength, ()), (angle, ()), (1. if color is None else color, (3,))))
        return SgLightingParameters(*sg_from_sun(direction, strength, angle, color))

    def cuda(self) -> SgLightingParameters:
        """Itself: tilegrad renders on the CPU."""
        return self

    def cpu(self) -> SgLightingParameters:
        """Itself."""
        return self

    def to(self, device: Any) -> SgLightingParameters:
        """Itself, whatever the device."""
        del device
        return self


def sg_from_sun(direction: torch.Tensor, strength: torch.Tensor, angle: torch.Tensor,
                color: torch.Tensor) -> _Gaussians:
    """Suns of strength [N], color [N,3], and a diameter of angle [N], radians, at whose rim the
    radiance is 1/2."""
    sharpness = torch.log(0.5 / strength) / (torch.cos(angle / 2) - 1)
    return color * strength.unsqueeze(-1), direction, sharpness


def sg_direction_from_azimuth_elevation(azimuth: Union[float, torch.Tensor],
                                        elevation: Union[float, torch.Tensor]) -> torch.Tensor:
    """[N,3], y up, azimuth from z towards x; radians."""
    azimuth, elevation = (torch.as_tensor(v, dtype=None if isinstance(v, torch.Tensor)
                                          else torch.float32).reshape(-1)
                          for v in (azimuth, elevation))
    azimuth, elevation = torch.broadcast_tensors(azimuth, elevation)
    across = torch.cos(elevation)
    return torch.stack([torch.sin(azimuth) * across, torch.sin(elevation),
                        torch.cos(azimuth) * across], dim=-1)


def cosine_lobe_sg(direction: torch.Tensor) -> _Gaussians:
    """The one that is closest to the clamped cosine around direction [...,3]."""
    return (torch.full_like(direction, 1.17), direction,
            torch.full_like(direction[..., 0], 2.133))


def approximate_sg_integral(amplitude: torch.Tensor, sharpness: torch.Tensor) -> torch.Tensor:
    """[N,3], over the sphere, but for a factor of 1 - exp(-2 sharpness)."""
    return 2 * math.pi * amplitude / sharpness.unsqueeze(-1)


@full_precision
def sg_irradiance_inner_product(amplitude: torch.Tensor, direction: torch.Tensor,
                                sharpness: torch.Tensor, normal: torch.Tensor) -> torch.Tensor:
    """Irradiance [P,3] at normal [P,3], by the cosine lobe's inner product with all lights."""
    lights = _checked("sg_irradiance_inner_product", amplitude, direction, sharpness, normal=normal)
    return _sum_of_products(cosine_lobe_sg(normal), lights).clamp(min=0)


@full_precision
def sg_diffuse_inner_product(amplitude: torch.Tensor, direction: torch.Tensor,
                             sharpness: torch.Tensor, normal: torch.Tensor,
                             albedo: torch.Tensor) -> torch.Tensor:
    """What a diffuse surface with normal [P,3] and albedo [P,3] reflects, [P,3]: DIB-R++'s."""
    return sg_irradiance_inner_product(amplitude, direction, sharpness,
                                       normal) * albedo / math.pi


@full_precision
def sg_irradiance_fitted(amplitude: torch.Tensor, direction: torch.Tensor,
                         sharpness: torch.Tensor, normal: torch.Tensor) -> torch.Tensor:
    """Irradiance of each light at normal [P,3], [P,N,3], by Stephen Hill's fit."""
    _checked("sg_irradiance_fitted", amplitude, direction, sharpness, normal=normal)
    cosine = normal @ direction.T
    # 1 - scale, computed so that it does not cancel.
    shortfall = 1 / sharpness - 2 * torch.exp(-2 * sharpness)
    bias = ((torch.exp(-sharpness) - torch.exp(-2 * sharpness)) / sharpness
            - torch.exp(-2 * sharpness))
    root = torch.sqrt(shortfall)
    bent, reach = 0.36 * cosine, root / (4 * 0.36)
    smooth = torch.where(bent.abs() <= reach, (bent + reach)**2 / root, cosine.clamp(0, 1))
    return ((1 - shortfall) * smooth + bias).unsqueeze(-1) * approximate_sg_integral(amplitude,
                                                                                    sharpness)


@full_precision
def sg_diffuse_fitted(amplitude: torch.Tensor, direction: torch.Tensor, sharpness: torch.Tensor,
                      normal: torch.Tensor, albedo: torch.Tensor) -> torch.Tensor:
    """As sg_diffuse_inner_product, by sg_irradiance_fitted."""
    irradiance = sg_irradiance_fitted(amplitude, direction, sharpness, normal).sum(dim=1)
    return irradiance.clamp(min=0) * albedo / math.pi


def sg_distribution_term(direction: torch.Tensor, roughness: torch.Tensor) -> _Gaussians:
    """GGX's distribution of normals around direction [P,3], for roughness [P], as one lobe."""
    squared = roughness**2
    return (1 / (math.pi * squared)).unsqueeze(-1).expand(-1, 3), direction, 2 / squared


def sg_warp_distribution(amplitude: torch.Tensor, direction: torch.Tensor,
                         sharpness: torch.Tensor, view: torch.Tensor) -> _Gaussians:
    """The distribution of normals as one of light's directions, seen from view [P,3]."""
    along = _dot(direction, view)
    return (amplitude, 2 * along * direction - view,
            sharpness / (4 * along.squeeze(-1).clamp(min=1e-4)))


def fresnel(ldh: torch.Tensor, spec_albedo: torch.Tensor) -> torch.Tensor:
    """Schlick's approximation. ldh: the cosine between light and half vector."""
    return spec_albedo + (1 - spec_albedo) * (1 - ldh)**5


@full_precision
def sg_warp_specular_term(amplitude: torch.Tensor, direction: torch.Tensor,
                          sharpness: torch.Tensor, normal: torch.Tensor, roughness: torch.Tensor,
                          view: torch.Tensor, spec_albedo: torch.Tensor) -> torch.Tensor:
    """What a surface with normal [P,3], roughness [P] and spec_albedo [P,3] reflects towards view
    [P,3] by Cook and Torrance's model, [P,3]."""
    lights = _checked("sg_warp_specular_term", amplitude, direction, sharpness, normal=normal,
                      view=view, spec_albedo=spec_albedo)
    lobe = sg_warp_distribution(*sg_distribution_term(normal, roughness), view)
    to_light = lobe[1]
    half = torch.nn.functional.normalize(to_light + view, dim=-1)
    facing, seen = (_dot(normal, v).clamp(0, 1) for v in (to_light, view))
    squared = (roughness**2).unsqueeze(-1)
    visible = 1
    for cosine in (facing, seen):
        visible = visible / (cosine + torch.sqrt(squared + (1 - squared) * cosine**2))
    reflected = (_sum_of_products(lobe, lights) * visible * facing
                 * fresnel(_dot(to_light, half).clamp(0, 1), spec_albedo))
    return reflected.clamp(min=0)


def _sum_of_products(ours: _Gaussians, others: _Gaussians) -> torch.Tensor:
    """[P,3]: the integrals over the sphere of each of `ours` with each of `others`, summed."""
    (amplitude, direction, sharpness), (other, towards, sharp) = ours, others
    joint = sharpness[:, None, None] * direction[:, None] + sharp[:, None] * towards
    length = joint.norm(dim=-1)
    falloff = torch.exp(length - sharpness[:, None] - sharp)
    weight = 2 * math.pi * falloff * _decay_ratio(length)
    return amplitude * (weight @ other)


def _decay_ratio(length: torch.Tensor) -> torch.Tensor:
    """(1 - exp(-2 length)) / length; near 0, where lobes cancel and that is 0 / 0, its series."""
    small = length < 1e-4
    near, large = length.masked_fill(~small, 0), length.masked_fill(small, 1)
    series = 2 - near * (2 - near * (4 - 2 * near) / 3)
    return torch.where(small, series, -torch.expm1(-2 * large) / large)


def _dot(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return (a * b).sum(dim=-1, keepdim=True)


def _checked(name: str, amplitude: torch.Tensor, direction: torch.Tensor, sharpness: torch.Tensor,
             **of_points: torch.Tensor) -> _Gaussians:
    """The lights; errors as check_floats."""
    sizes: dict = {}
    check_floats(name, "amplitude", amplitude, ("N", 3), sizes)
    check_floats(name, "direction", direction, ("N", 3), sizes, amplitude)
    check_floats(name, "sharpness", sharpness, ("N",), sizes, amplitude)
    for argument, value in of_points.items():
        check_floats(name, argument, value, ("P", 3), sizes, amplitude)
    return amplitude, direction, sharpness
