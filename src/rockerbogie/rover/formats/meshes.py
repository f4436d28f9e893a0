"""Mesh files that a robot file refers to.

They are found beside it, read by trimesh, and reduced to vertices and mass properties.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from ...arrays import Array

#: Endings that are read; DAE needs pycollada.
ENDINGS = (".stl", ".obj", ".ply", ".off", ".dae", ".glb", ".gltf")
#: Larger mesh files are not read.
MAX_BYTES = 200_000_000
#: Folders above the robot file that are searched for `package://` and `model://`.
MOST_FOLDERS = 8
INSTALL = "reading meshes needs trimesh: pip install 'rockerbogie[robots]'"


@dataclass(frozen=True)
class Mesh:
    """Mesh, as far as it is needed: vertices and mass properties at density 1.

    `points` (n, 3), m; `volume`, m³; its `centre` (3,), m; `inertia` (3, 3) about the centre.
    """

    points: Array
    volume: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def scaled(self, scale: Array) -> Mesh:
        """Return the mesh stretched along its axes.

        Args:
            scale: (3,) factors.

        Returns:
            A new mesh.
        """
        second = np.eye(3) * np.trace(self.inertia) / 2 - self.inertia  # ∫ x xᵀ
        factor = abs(float(np.prod(scale)))
        second = factor * second * np.outer(scale, scale)
        inertia = np.eye(3) * np.trace(second) - second
        return Mesh(self.points * scale, self.volume * factor, self.centre * scale, inertia)


@dataclass
class MeshFolder:
    """Mesh files of one robot file.

    `failed` maps the address of each mesh that was not read to the reason.
    """

    folder: Path | None
    failed: dict[str, str] = field(default_factory=dict)
    _read: dict[str, Mesh | None] = field(default_factory=dict)

    def load(self, address: str) -> Mesh | None:
        """Return the mesh at an address, or None with the reason in `failed`.

        Args:
            address: a path relative to the robot file, or `package://`, `model://` or `file://`.

        Returns:
            The mesh, or None.
        """
        if address not in self._read:
            path = self.find(address)
            if path is None:
                self.failed[address] = "not found beside the robot file"
                self._read[address] = None
            else:
                self._read[address] = self._load(address, path)
        return self._read[address]

    def find(self, address: str) -> Path | None:
        """Return the path of the file at an address, or None if there is none.

        `package://NAME/rest` and `model://NAME/rest` are searched in the folders above the robot file.

        Args:
            address: as for `load`.

        Returns:
            The path, or None.
        """
        if self.folder is None or not address or "\0" in address:
            return None
        scheme, colon, rest = address.partition("://")
        candidates = []
        folder = self.folder.resolve()
        if not colon:
            candidates = [folder / address]
        elif scheme == "file":
            candidates = [Path(unquote(rest)), folder / unquote(rest).lstrip("/")]
        elif scheme in ("package", "model"):
            name, _, inside = rest.partition("/")
            for above in (folder, *folder.parents)[:MOST_FOLDERS]:
                candidates += [above / name / inside, above / "src" / name / inside]
                candidates += [above / inside] if above.name == name or (above / "package.xml").is_file() else []
        try:
            return next((path for path in candidates if path.is_file()), None)
        except OSError:
            return None

    def _load(self, address: str, path: Path) -> Mesh | None:
        """Return the mesh of one file; None if it is not readable, with the reason in `failed`.

        trimesh reads it from memory, so that it cannot open further files.
        """
        try:
            import trimesh
        except ImportError:
            self.failed[address] = INSTALL
            return None
        ending = path.suffix.lower()
        if ending not in ENDINGS:
            self.failed[address] = f"{ending or 'its format'} is not read; convert it to STL"
            return None
        try:
            if path.stat().st_size > MAX_BYTES:
                self.failed[address] = f"larger than {MAX_BYTES / 1e6:.0f} MB"
                return None
            loaded = trimesh.load_mesh(io.BytesIO(path.read_bytes()), file_type=ending[1:])
            points = np.asarray(loaded.vertices, dtype=float)
            unit = _unit(loaded.metadata.get("units"))
            if points.ndim != 2 or not len(points) or not np.isfinite(points).all():
                raise ValueError("no vertices")
            hull = loaded if loaded.is_watertight else loaded.convex_hull
            volume = abs(float(hull.volume))
            inertia = np.asarray(hull.moment_inertia, dtype=float) * np.sign(float(hull.volume) or 1.0)
            return Mesh(points * unit, volume * unit**3, np.asarray(hull.center_mass) * unit, inertia * unit**5)
        except Exception as error:  # readers of foreign meshes fail in many ways
            self.failed[address] = f"not readable ({type(error).__name__}: {' '.join(str(error).split())[:80]})"
            return None


def _unit(text: object) -> float:
    """Return metres in a mesh's unit of length; 1 if it states none.

    The unit is stated by trimesh's DAE reader in words.
    """
    match = re.fullmatch(r"([-+.\deE]+) \* meters", str(text))
    return float(match[1]) if match else 1.0
