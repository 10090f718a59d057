"""Interfaces of ROS 2 that no wheel has, generated and compiled by what the wheels bring: `make ros2` calls it.

FollowJointTrajectory, which controllers of arms offer, and TFMessage, in which frames come. They land beside the other
messages, in the environment whose Python runs this.
"""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path
from shutil import copytree, rmtree
from tempfile import TemporaryDirectory

_TOLERANCE = "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
_FOLLOW = """trajectory_msgs/JointTrajectory trajectory
JointTolerance[] path_tolerance
JointTolerance[] goal_tolerance
builtin_interfaces/Duration goal_time_tolerance
---
int32 error_code
string error_string
---
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
"""
PACKAGES = {
    "control_msgs": {"msg/JointTolerance.msg": _TOLERANCE, "action/FollowJointTrajectory.action": _FOLLOW},
    "tf2_msgs": {"msg/TFMessage.msg": "geometry_msgs/TransformStamped[] transforms\n"},
}
_TYPES = ("__rosidl_generator_c", "__rosidl_typesupport_c", "__rosidl_typesupport_fastrtps_c", "__rosidl_generator_py")
_RUNTIME = (
    "rosidl_runtime_c", "rosidl_typesupport_c", "rosidl_typesupport_fastrtps_c", "rosidl_typesupport_fastrtps_cpp",
    "rcutils", "fastcdr", "rmw", "tracetools",
)  # fmt: skip


def generate(package, definitions, folder):
    """Write the sources of a package into a folder."""
    from rosidl_adapter.action import convert_action_to_idl
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport

    texts, described = folder.parent / f"{package}_texts", []
    for name, text in definitions.items():
        path = texts / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        convert = convert_msg_to_idl if path.suffix == ".msg" else convert_action_to_idl
        convert(texts, package, Path(name), folder / Path(name).parent)
        described.append(f"{folder}:{Path(name).with_suffix('.idl')}")
    for kind in (GenerateC, GenerateCTypesupport, GenerateFastRTPSCTypesupport, GeneratePython):
        generator = kind.__new__(kind)  # the constructor looks for implementations where wheels do not list them
        wanted = "rosidl_typesupport_c" if kind is GeneratePython else "rosidl_typesupport_fastrtps_c"
        setattr(generator, f"_{kind.__name__}__typesupport_implementations", [wanted])
        generator.generate(package, described, [str(Path(sys.prefix) / "share")], folder)


def compile_sources(package, folder):
    """Compile the sources in a folder to the libraries that Python loads."""
    import numpy

    prefix, libraries = Path(sys.prefix), folder / "lib"
    libraries.mkdir()
    include = prefix / "include"
    headers = [include, *(path for path in include.iterdir() if path.is_dir()), folder.parent,
               sysconfig.get_paths()["include"], numpy.get_include()]  # fmt: skip
    places = [f"-L{place}" for place in (prefix / "lib", libraries)]
    places += [f"-Wl,-rpath,$ORIGIN,-rpath,$ORIGIN/lib,-rpath,{prefix / 'lib'}"]
    there = sorted(path.name[3:-3] for path in (prefix / "lib").glob("lib*.so"))
    common = [f"-l{name}" for name in there if name.endswith(_TYPES) or name in _RUNTIME]
    own = []
    for suffix, pattern in zip(_TYPES, ("*/detail/*.c", "*/*.cpp", "*/detail/*.cpp", "*/*_s.c"), strict=True):
        own.append((f"{package}{suffix}", pattern))
    own = [own[0], own[2], own[1], own[3]]  # each is linked with those before
    module = f"{package}_s__rosidl_typesupport_c{sysconfig.get_config_var('EXT_SUFFIX')}"
    targets = [(libraries / f"lib{name}.so", pattern) for name, pattern in own] + [(folder / module, "_*.c")]
    for k, (target, pattern) in enumerate(targets):
        sources = sorted(map(str, folder.glob(pattern)))
        compiler = "g++" if sources[0].endswith(".cpp") else "gcc"
        before = [f"-l{name}" for name, _ in own[:k]]
        command = [compiler, "-shared", "-fPIC", "-O0", "-o", str(target), *(f"-I{path}" for path in headers), *sources]
        subprocess.run([*command, *places, *before, *common], check=True)


def main():
    """Build all packages."""
    os.environ["AMENT_PREFIX_PATH"] = sys.prefix
    site = Path(sysconfig.get_paths()["purelib"])
    for package, definitions in PACKAGES.items():
        with TemporaryDirectory() as scratch:
            folder = Path(scratch) / package
            generate(package, definitions, folder)
            compile_sources(package, folder)
            (folder / "__init__.py").touch()
            rmtree(site / package, ignore_errors=True)
            copytree(folder, site / package)


if __name__ == "__main__":
    main()
