"""Build tf2_msgs and grid_map_msgs, which have no wheels on PyPI, from their definitions.

    pip install 'rockerbogie[ros2]' catkin-pkg 'empy<4' lark
    python tools/ros_messages.py ros_messages
    PYTHONPATH=ros_messages rockerbogie ros --rover osr

The generators of the wheels (rosidl) write the sources, and the C++ compiler makes one extension module per package, with
support for Fast DDS only. An installation of ROS 2 brings both packages itself.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

PREFIX = Path(sys.prefix)
SUPPORT = "rosidl_typesupport_fastrtps_c"
#: Definitions, as ROS 2 has them.
DEFINITIONS = {
    "tf2_msgs": {"TFMessage": "geometry_msgs/TransformStamped[] transforms\n"},
    "grid_map_msgs": {
        "GridMapInfo": "float64 resolution\nfloat64 length_x\nfloat64 length_y\ngeometry_msgs/Pose pose\n",
        "GridMap": (
            "std_msgs/Header header\nGridMapInfo info\nstring[] layers\nstring[] basic_layers\n"
            "std_msgs/Float32MultiArray[] data\nuint16 outer_start_index\nuint16 inner_start_index\n"
        ),
    },
}
#: Packages of which the definitions use messages, directly or not.
NEEDED = ("geometry_msgs", "std_msgs", "builtin_interfaces", "service_msgs")
LIBRARIES = (
    *(f"{name}__{kind}" for name in NEEDED for kind in ("rosidl_generator_c", "rosidl_typesupport_c", SUPPORT)),
    *(f"{name}__rosidl_generator_py" for name in NEEDED[:3]),
    "rosidl_typesupport_c", SUPPORT, "rosidl_typesupport_fastrtps_cpp", "rosidl_runtime_c", "rcutils", "rmw",
)  # fmt: skip
#: Names of the packages on PyPI that this script imports besides the wheels of ROS 2.
GENERATORS = ("catkin_pkg", "em", "lark")


def build(folder: Path) -> list[Path]:
    """Build all packages that are not in a folder yet.

    Args:
        folder: for PYTHONPATH.

    Returns:
        The folders of the packages.

    Raises:
        subprocess.CalledProcessError: the compiler fails.
        ImportError: a generator is not installed.
    """
    return [_build(folder, name, messages) for name, messages in DEFINITIONS.items()]


def _build(folder: Path, name: str, messages: dict[str, str]) -> Path:
    """Build a package, in a scratch folder first; return its folder."""
    final, scratch = folder / name, folder / f".{name}"
    if final.exists():
        return final
    shutil.rmtree(scratch, ignore_errors=True)
    package = scratch / name  # also the folder of includes: <scratch>/<name>/msg/detail/…
    (package / "msg").mkdir(parents=True)
    _generate(package, name, messages)
    sources = [file for file in package.rglob("*.c*") if file.suffix in (".c", ".cpp") and "introspection" not in file.name]
    headers = PREFIX / "include"
    folders = (scratch, sysconfig.get_path("include"), np.get_include(), headers, *headers.iterdir())
    includes = [f"-I{path}" for path in folders]
    options = ["-O1", "-fPIC", "-w", f'-DROS_PACKAGE_NAME="{name}"', *includes]

    def compiled(source: Path) -> str:
        target = source.with_suffix(f"{source.suffix}.o")
        compiler = ["gcc"] if source.suffix == ".c" else ["g++", "-std=c++17"]
        subprocess.run([*compiler, *options, "-c", str(source), "-o", str(target)], check=True)
        return str(target)

    with ThreadPoolExecutor() as pool:
        objects = list(pool.map(compiled, sources))
    library = PREFIX / "lib"
    module = package / f"{name}_s__rosidl_typesupport_c.so"
    links = [f"-l:lib{item}.so" for item in LIBRARIES] + ["-l:libfastcdr.so.2"]
    subprocess.run(["g++", "-shared", "-o", str(module), *objects, f"-L{library}", f"-Wl,-rpath,{library}", *links], check=True)
    for file in package.rglob("*"):
        if file.is_file() and file.suffix not in (".py", ".so"):
            file.unlink()
    (package / "__init__.py").touch()
    package.rename(final)
    shutil.rmtree(scratch)
    return final


def _generate(package: Path, name: str, messages: dict[str, str]) -> None:
    """Write the sources of a package."""
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_generator_c import generate_c
    from rosidl_generator_py import generate_py
    from rosidl_generator_type_description import generate_type_hash
    from rosidl_typesupport_c import generate_c as generate_support
    from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c

    root = package.parent
    for message, text in messages.items():
        (package / "msg" / f"{message}.msg").write_text(text, encoding="utf-8")
        convert_msg_to_idl(package, name, Path("msg") / f"{message}.msg", package / "msg")
    files = [f"msg/{message}.idl" for message in messages]
    known = [f"{other}:{file}" for other in NEEDED for file in (PREFIX / "share" / other).rglob("*.idl")]

    def arguments(generator: str) -> str:
        """Write the arguments of a generator; return the file."""
        found = {
            "package_name": name,
            "output_dir": str(package),
            "template_dir": str(PREFIX / "share" / generator / "resource"),
            "idl_tuples": [f"{package}:{file}" for file in files],
            "ros_interface_dependencies": known,
            "ros_interface_files": [str((package / file).with_suffix(".msg")) for file in files],
            "include_paths": [f"{other}:{PREFIX / 'share' / other}" for other in NEEDED],
            "target_dependencies": [],
            "type_description_tuples": [f"{file}:{(package / file).with_suffix('.json')}" for file in files],
        }
        target = root / f"{generator}.json"
        target.write_text(json.dumps(found), encoding="utf-8")
        return str(target)

    generate_type_hash(arguments("rosidl_generator_type_description"))
    generate_c(arguments("rosidl_generator_c"))
    generate_support(arguments("rosidl_typesupport_c"), [SUPPORT])
    generate_typesupport_fastrtps_c(arguments(SUPPORT))
    generate_py(arguments("rosidl_generator_py"), ["rosidl_typesupport_c"])
    for generator in ("rosidl_generator_c", SUPPORT):
        header = f"{generator}__visibility_control.h"
        text = (PREFIX / "share" / generator / "resource" / f"{header}.in").read_text(encoding="utf-8")
        text = text.replace("@PROJECT_NAME@", name).replace("@PROJECT_NAME_UPPER@", name.upper())
        (package / "msg" / header).write_text(text, encoding="utf-8")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for PYTHONPATH; made if missing")
    for package in build(parser.parse_args().folder.resolve()):
        print(package)


if __name__ == "__main__":
    main()
