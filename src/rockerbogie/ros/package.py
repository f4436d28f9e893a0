"""Package for colcon: an ament_python skeleton with launch file, parameters and rover."""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isinf
from pathlib import Path
from typing import Any

from ..files.outputs import check_outputs
from ..files.version import __version__
from ..rover.formats import to_toml
from ..rover.model import Rover
from .parameters import PARAMETERS

NAME, SUFFIX = "rockerbogie_ros", ".in"
TEMPLATES = Path(__file__).resolve().parent / "package"
#: Parameters that the launch file sets.
BY_LAUNCH = ("rover",)


def write_package(folder: str | Path, rover: Rover, parameters: Mapping[str, Any], *, force: bool = False) -> list[Path]:
    """Write a package that colcon can build.

    Args:
        folder: the package becomes its subfolder `rockerbogie_ros`; usually the `src` of a workspace.
        rover: the rover, which is written to `config/rover.toml`.
        parameters: values of parameters other than their defaults.
        force: replace files that this package did not write.

    Returns:
        The files.

    Raises:
        RockerbogieError: a file is there already, or cannot be written.
    """
    root = Path(folder) / NAME
    texts = {
        root / file.relative_to(TEMPLATES).with_suffix("" if file.suffix == SUFFIX else file.suffix): file.read_text(
            encoding="utf-8"
        ).replace("@VERSION@", __version__)
        for file in sorted(TEMPLATES.rglob(f"*{SUFFIX}"))
    }
    texts[root / "config" / "rover.toml"] = to_toml(rover)
    texts[root / "config" / "rover.yaml"] = parameter_file(parameters)
    check_outputs(list(texts), force=force)
    for file, text in texts.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    return list(texts)


def parameter_file(values: Mapping[str, Any]) -> str:
    """Return a file of all parameters, each with its meaning.

    Args:
        values: those other than the defaults.

    Returns:
        YAML for --params-file.
    """
    lines = ["# written by rockerbogie: parameters of its node", "/**:", "  ros__parameters:"]
    for name, parameter in PARAMETERS.items():
        value = values.get(name, parameter.default)
        line = f"    {name}: {_yaml(value)}  # {parameter.text}"
        lines.append(f"    # {line.strip()}" if name in BY_LAUNCH else line)
    return "\n".join(lines) + "\n"


def _yaml(value: Any) -> str:
    """Return a value as YAML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(_yaml(v) for v in value)}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # also a text of YAML
    if isinstance(value, float) and isinf(value):
        return ".inf" if value > 0 else "-.inf"
    return repr(value)
