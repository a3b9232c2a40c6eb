"""Parameters by region and by network: the paper's schemes, as a calibration keeps and evaluates them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from truearm._core import Network, Regions
from truearm.types import Floats

if TYPE_CHECKING:
    from truearm._core import NetworkOptions

Arrays = dict[str, NDArray[Any]]

REGIONS: Final = "regions"
CMAC: Final = "cmac"
FCMAC: Final = "fcmac"
NETWORKS: Final = (CMAC, FCMAC)
SCHEMES: Final = (REGIONS, *NETWORKS)
GRID_A_REGION: Final = 3
GRID_AXES: Final = 3
POINTS_A_REGION: Final = GRID_A_REGION**GRID_AXES


@dataclass(frozen=True, eq=False)
class RegionalCeps:
    """CEPs that are constant in each region.

    Attributes:
        inputs: Indices of the inputs that regions are of.
        columns: Parameters that the P CEPs correct, indices 5 * row + (theta, d, a, alpha, beta).
        regions: The tree.
        ceps: CEPs of each node (nodes, P), beside the constants.
    """

    inputs: tuple[int, ...]
    columns: tuple[int, ...]
    regions: Regions
    ceps: Floats

    def ceps_at(self, inputs: Floats) -> Floats:
        """CEPs (n, P) at inputs (n, I)."""
        chosen = np.ascontiguousarray(inputs[:, list(self.inputs)])
        return np.asarray(self.ceps[self.regions.find(chosen)])

    def pack(self, name: str, arrays: Arrays) -> dict[str, Any]:
        """JSON values; arrays are added to `arrays`."""
        arrays[f"{name}.region_ceps"] = self.ceps
        for part, values in self.regions.arrays().items():
            arrays[f"{name}.regions.{part}"] = values
        return {"kind": REGIONS, "inputs": list(self.inputs), "columns": list(self.columns)}


@dataclass(frozen=True, eq=False)
class NetworkCeps:
    """CEPs of a CMAC or an FCMAC.

    Attributes:
        inputs: Indices of the inputs that it has sensors for.
        columns: Parameters that the P CEPs correct.
        network: The network.
        options: Membership, sigma, composition and table that it was made with.
    """

    inputs: tuple[int, ...]
    columns: tuple[int, ...]
    network: Network
    options: "NetworkOptions"

    def ceps_at(self, inputs: Floats) -> Floats:
        """CEPs (n, P) at inputs (n, I)."""
        return self.network.output(np.ascontiguousarray(inputs[:, list(self.inputs)]))

    def pack(self, name: str, arrays: Arrays) -> dict[str, Any]:
        """JSON values; arrays are added to `arrays`."""
        arrays[f"{name}.weights"] = self.network.weights
        return {
            "kind": FCMAC,
            "inputs": list(self.inputs),
            "columns": list(self.columns),
            "sensors": [list(sensor) for sensor in self.network.sensors],
            "options": dict(self.options),
        }


Scheme = RegionalCeps | NetworkCeps


def unpack(content: Mapping[str, Any], name: str, arrays: Arrays) -> Scheme:
    """The scheme that `pack` described.

    Raises:
        KeyError: If an array or a key is missing.
    """
    inputs, columns = tuple(content["inputs"]), tuple(content["columns"])
    if content["kind"] == REGIONS:
        parts = {part: arrays[f"{name}.regions.{part}"] for part in ("low", "high", "axis", "child")}
        return RegionalCeps(inputs, columns, Regions.from_arrays(parts), arrays[f"{name}.region_ceps"])
    sensors = [(low, high, cells, c) for low, high, cells, c in content["sensors"]]
    options: NetworkOptions = content["options"]
    empty = Network(sensors, len(columns), options)
    return NetworkCeps(inputs, columns, empty.with_weights(arrays[f"{name}.weights"]), options)


def add_ceps(parameters: Floats, columns: Sequence[int], ceps: Floats) -> Floats:
    """Parameters (n, L, 5): those of (L, 5) with CEPs (n, P) added to their columns."""
    found = np.repeat(parameters.reshape(1, -1), len(ceps), axis=0)
    found[:, list(columns)] += ceps
    return found.reshape(len(ceps), *parameters.shape)


def training_pairs(regions: Regions, ceps: Floats) -> tuple[Floats, Floats]:
    """Several points of each leaf with its CEPs, section 6: inputs (k, D) and CEPs (k, P).

    Over up to three inputs the points are a grid of three by three by three, over more as many drawn ones.
    Leaves without CEPs are left out.
    """
    leaves = regions.leaves[np.isfinite(ceps[regions.leaves]).all(axis=1)]
    low, high = regions.low[leaves], regions.high[leaves]
    part = _parts(low.shape[1])
    inputs = low[:, None] + part * (high - low)[:, None]
    return np.ascontiguousarray(inputs.reshape(-1, low.shape[1])), np.repeat(ceps[leaves], len(part), axis=0)


def _parts(dimensions: int) -> Floats:
    """Points (k, D) of the unit box."""
    if dimensions > GRID_AXES:
        return np.random.default_rng(0).uniform(size=(POINTS_A_REGION, dimensions))
    part = (np.arange(GRID_A_REGION) + 0.5) / GRID_A_REGION
    return np.stack(np.meshgrid(*[part] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions)
