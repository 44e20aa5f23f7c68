"""A data set of random scenes for training, in the style of PyTorch, which it does not need.

    python scenes.py

``torch.utils.data.DataLoader(RandomScenes(1000), batch_size=8, num_workers=4)`` loads it in several processes.
"""

from __future__ import annotations

import random
from typing import TypedDict

import numpy as np
import phasmid
from numpy.typing import NDArray


class Sample(TypedDict):
    """What a network learns from, and what it is to find."""

    #: Grey levels from 0 to 1, (frames, rows, columns).
    frames: NDArray[np.float32]
    #: True depth in millimetres, (rows, columns), 0 where there is none.
    depth_mm: NDArray[np.float32]
    #: Where the depth is known: seen, lit, and not at the edge of something.
    mask: NDArray[np.bool_]


class RandomScenes:
    """Spheres at random places with random brightness. Equal indices give equal samples, in any process.

    Parameters
    ----------
    count : int
        Number of scenes.
    profile : str
        The device that sees them.
    seed : int
        Of the scenes and of the noise.
    """

    def __init__(self, count: int, profile: phasmid.Profile | str = "webcam-grey", seed: int = 0) -> None:
        self.count = count
        self.profile = profile
        self.seed = seed

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Sample:
        if not 0 <= index < self.count:
            raise IndexError(index)
        numbers = random.Random(f"{self.seed} {index}")
        x, y, z = (numbers.uniform(*bounds) for bounds in ((-60, 60), (-40, 40), (700, 900)))
        scene = phasmid.Scene("sphere").with_(
            **{"object[0].position_mm": [x, y, z], "object[0].albedo": numbers.uniform(0.2, 0.9)}
        )
        capture, truth = phasmid.render(self.profile, scene, seed=numbers.getrandbits(32))
        wanted = truth.SEEN | truth.LIT
        mask = (truth.flags & (wanted | truth.CREASE)) == wanted
        full = np.float32(np.iinfo(capture.frames.dtype).max)
        return {
            "frames": (capture.frames / full).astype(np.float32),
            "depth_mm": np.where(mask, truth.depth_mm, np.float32(0)),
            "mask": mask,
        }


if __name__ == "__main__":
    for sample in (RandomScenes(4)[i] for i in range(4)):
        depth = sample["depth_mm"][sample["mask"]]
        print(f"{depth.size} pixels at {depth.min():.0f} to {depth.max():.0f} mm")
