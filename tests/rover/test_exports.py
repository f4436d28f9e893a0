"""Exported rovers in other programs: parsers accept them; on rocks, the differential holds."""

from __future__ import annotations

import datetime
import shutil
import subprocess
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rockerbogie as rb
from rockerbogie.rover.formats import build_rover, presets, read_trees
from support.helpers import assert_close
from support.rocks import rocks, start_height

Array = NDArray[np.float64]
NAMES = sorted(presets())
#: Largest error of a differential, rad.
HELD = 1e-3


def barred() -> rb.Rover:
    """A rover whose differential bar is no plain ratio: 1 deg off at 32 deg."""
    from test_differential import BAR

    base = rb.load_rover("perseverance")
    return base.replace(differential=BAR.polynomial(base.rocker_pivot[0], base.rocker_limits))


def in_drake(rover: rb.Rover, text: str, kind: str) -> Array:
    """Angles (n, 2) of the rockers, dropped on rocks in Drake."""
    drake = pytest.importorskip("pydrake.all", reason="Drake is not installed")
    builder = drake.DiagramBuilder()
    plant, _ = drake.AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
    plant.set_discrete_contact_approximation(drake.DiscreteContactApproximation.kSap)
    drake.Parser(plant).AddModelsFromString(text, kind)
    friction = drake.CoulombFriction(0.8, 0.8)
    for k, (size, at, rpy) in enumerate([((20.0, 20.0, 1.0), (0.0, 0.0, -0.5), (0.0, 0.0, 0.0)), *rocks(rover)]):
        pose = drake.RigidTransform(drake.RollPitchYaw(*rpy), at)
        plant.RegisterCollisionGeometry(plant.world_body(), pose, drake.Box(*size), f"rock{k}", friction)
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    base = plant.GetBodyByName("base_link")
    plant.SetFreeBodyPose(context, base, drake.RigidTransform([0.0, 0.0, start_height(rover)]))
    joints = [plant.GetJointByName(f"rocker_{side}_joint") for side in ("left", "right")]
    angles = []
    for step in range(300):
        simulator.AdvanceTo(0.005 * (step + 1))
        angles.append([joint.get_angle(context) for joint in joints])
    return np.array(angles)


@pytest.mark.parametrize("name", ["osr", "curiosity"])
@pytest.mark.parametrize("kind", ["urdf", "sdf"])
def test_drake_holds_the_differential(kind: str, name: str) -> None:
    rover = rb.load_rover(name)
    angles = in_drake(rover, rb.to_urdf(rover) if kind == "urdf" else rb.to_sdf(rover), kind)
    assert np.abs(angles[:, 0]).max() > 0.005, "the rocks turn the rockers"
    assert np.abs(angles.sum(axis=1)).max() <= HELD


@pytest.mark.parametrize("name", ["osr", "curiosity"])
def test_mujoco_holds_the_differential(name: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    rover = rb.load_rover(name)
    spec = mujoco.MjSpec.from_string(rb.to_mjcf(rover))
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    for size, at, rpy in rocks(rover):
        quat = Rotation.from_euler("xyz", rpy).as_quat(scalar_first=True)
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=np.array(size) / 2, pos=at, quat=quat)
    spec.option.timestep = 1e-3
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[2] = start_height(rover)
    left, right = (model.jnt_qposadr[model.joint(f"rocker_{side}").id] for side in ("left", "right"))
    angles = []
    for _ in range(1500):
        mujoco.mj_step(model, data)
        angles.append([data.qpos[left], data.qpos[right]])
    found = np.array(angles)
    assert np.abs(found[:, 0]).max() > 0.005, "the rocks turn the rockers"
    assert np.abs(found.sum(axis=1)).max() <= HELD


class FakeJoint:
    """Joint of Gazebo's Python API, on a joint of DART."""

    def __init__(self, joint: Any) -> None:
        self.joint = joint

    def valid(self, ecm: Any) -> bool:
        return self.joint is not None

    def enable_position_check(self, ecm: Any, on: bool) -> None:
        assert on

    enable_velocity_check = enable_position_check

    def position(self, ecm: dict[str, int]) -> list[float] | None:
        return [self.joint.getPosition(0)] if ecm["steps"] else None

    def velocity(self, ecm: dict[str, int]) -> list[float] | None:
        return [self.joint.getVelocity(0)] if ecm["steps"] else None

    def set_force(self, ecm: Any, forces: list[float]) -> None:
        self.joint.setForce(0, forces[0])


def fake_gazebo() -> SimpleNamespace:
    """Gazebo's Python module, as far as the system uses it."""
    model = lambda skeleton: SimpleNamespace(joint_by_name=lambda ecm, name: skeleton.getJoint(name))  # noqa: E731
    return SimpleNamespace(Model=model, Joint=FakeJoint)


def load_system() -> ModuleType:
    """The shipped source of the system, as Gazebo's loader imports it."""
    name, source = rb.differential_system()
    module = ModuleType(name.removesuffix(".py"))
    exec(compile(source, name, "exec"), module.__dict__)
    return module


def in_dart(rover: rb.Rover, folder: Path, steps: int = 2000, dt: float = 1e-3) -> Array:
    """Angles (n, 2) of the rockers, dropped on rocks in DART with the shipped system.

    DART reads SDF 1.6. The file has no element whose meaning changed after it, other than the version.
    """
    dart = pytest.importorskip("dartpy", reason="DART is not installed")
    text = rb.to_sdf(rover, differential="system")
    file = folder / "rover.sdf"
    file.write_text(text.replace('version="1.11"', 'version="1.6"'))
    skeleton = dart.utils.SdfParser.readSkeleton(str(file))
    world = dart.simulation.World()
    world.setTimeStep(dt)
    world.addSkeleton(skeleton)
    world.getConstraintSolver().setCollisionDetector(dart.collision.BulletCollisionDetector())
    for k, (size, at, rpy) in enumerate([((20.0, 20.0, 1.0), (0.0, 0.0, -0.5), (0.0, 0.0, 0.0)), *rocks(rover)]):
        rock = dart.dynamics.Skeleton(f"rock{k}")
        joint, body = rock.createWeldJointAndBodyNodePair()
        shape = body.createShapeNode(dart.dynamics.BoxShape(size))
        shape.createCollisionAspect()
        shape.createDynamicsAspect()
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = Rotation.from_euler("xyz", rpy).as_matrix(), at
        joint.setTransformFromParentBodyNode(dart.math.Isometry3(T))
        world.addSkeleton(rock)
    module = load_system()
    module.gazebo_module = fake_gazebo  # type: ignore[attr-defined]
    plugin = ElementTree.fromstring(text).find(".//plugin")
    assert plugin is not None
    assert plugin.findtext("module_name") == module.__name__
    system, ecm = module.get_system(), {"steps": 0}
    system.configure(skeleton, SimpleNamespace(get_string=plugin.findtext), ecm, None)
    place = skeleton.getPositions()
    place[5] = start_height(rover)
    skeleton.setPositions(place)
    joints = [skeleton.getJoint(plugin.findtext(side)) for side in ("left", "right")]
    info = SimpleNamespace(dt=datetime.timedelta(seconds=dt), paused=False)
    angles = []
    for _ in range(steps):
        system.pre_update(info, ecm)
        world.step()
        ecm["steps"] += 1
        angles.append([joint.getPosition(0) for joint in joints])
    return np.array(angles)


@pytest.mark.parametrize("name", ["osr", "curiosity", "bar"])
def test_the_gazebo_system_holds_the_differential_in_dart(name: str, tmp_path: Path) -> None:
    """The error is at most 1e-3 rad except in the steps after the impact.

    The system sees a change of rate one step later.
    """
    rover = barred() if name == "bar" else rb.load_rover(name)
    angles = in_dart(rover, tmp_path)
    error = np.abs(angles[:, 1] - polyval(angles[:, 0], rover.differential))
    assert np.abs(angles[:, 0]).max() > 0.005, "the rocks turn the rockers"
    assert error.max() <= 0.01
    assert (error > HELD).sum() <= 30, "30 steps of 1 ms, at impact"
    assert error[500:].max() <= 1e-4, "at rest"


def test_without_the_system_the_rockers_turn_freely_in_dart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The coupling is the system's doing, not that of the terrain or of DART."""
    monkeypatch.setattr(FakeJoint, "set_force", lambda self, ecm, forces: None)
    assert np.abs(in_dart(rb.load_rover("osr"), tmp_path, 1000).sum(axis=1)).max() > 0.1


@pytest.mark.parametrize("name", [*NAMES, "bar"])
@pytest.mark.parametrize("differential", ["mimic", "system"])
def test_libsdformat_accepts_the_sdf(name: str, differential: Any) -> None:
    """Drake reads SDF by libsdformat, and raises its errors."""
    drake = pytest.importorskip("pydrake.all", reason="Drake is not installed")
    rover = barred() if name == "bar" else rb.load_rover(name)
    plant = drake.MultibodyPlant(1e-3)
    (model,) = drake.Parser(plant).AddModelsFromString(rb.to_sdf(rover, differential=differential), "sdf")
    plant.Finalize()
    assert len(plant.GetBodyIndices(model)) == 11 + rover.steers.sum()
    assert plant.num_constraints() == (differential == "mimic")
    context = plant.CreateDefaultContext()
    assert_close(plant.CalcTotalMass(context, [model]), rover.mass, 1e-12 * rover.mass, "kg", "the sum of the links")
    for i, wheel in enumerate(rover.wheel_names):
        at = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(f"wheel_{wheel}")).translation()
        origin = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("base_link")).translation()
        assert_close(at - origin, rover.hubs[i], 1e-12, "m", wheel)


@pytest.mark.parametrize("name", NAMES)
def test_urdfdom_accepts_the_urdf(name: str, tmp_path: Path) -> None:
    if shutil.which("check_urdf") is None:
        pytest.skip("check_urdf (Debian liburdfdom-tools) is not installed")
    file = tmp_path / "rover.urdf"
    file.write_text(rb.to_urdf(rb.load_rover(name), ros2_control=True))
    done = subprocess.run(["check_urdf", str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", [*NAMES, "bar"])
def test_a_system_is_read_back(name: str) -> None:
    rover = barred() if name == "bar" else rb.load_rover(name)
    result = build_rover(read_trees(rb.to_sdf(rover, differential="system"), "test"), "test")
    assert not result.repaired
    assert (result.rover.differential == rover.differential).all()


@pytest.mark.parametrize("name", [*NAMES, "bar"])
def test_usd_holds_the_rover(name: str) -> None:
    """Poses, masses, inertias, shapes and the mimic joint, read by usd-core."""
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd, UsdGeom, UsdPhysics

    rover = barred() if name == "bar" else rb.load_rover(name)
    stage = Usd.Stage.CreateInMemory()
    assert stage.GetRootLayer().ImportFromString(rb.to_usd(rover))
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert UsdGeom.GetStageMetersPerUnit(stage) == UsdPhysics.GetStageKilogramsPerUnit(stage) == 1.0
    root = stage.GetDefaultPrim()
    assert root.HasAPI(UsdPhysics.ArticulationRootAPI)
    cache = UsdGeom.XformCache()
    mass = 0.0
    for prim in root.GetChildren():
        if not prim.HasAPI(UsdPhysics.RigidBodyAPI):
            continue
        about = UsdPhysics.MassAPI(prim)
        mass += about.GetMassAttr().Get()
        q = about.GetPrincipalAxesAttr().Get()
        turn = Rotation.from_quat([q.real, *q.imaginary], scalar_first=True).as_matrix()
        inertia = turn @ np.diag(about.GetDiagonalInertiaAttr().Get()) @ turn.T
        parts = {f"rocker_{s}": link for s, link in zip(("left", "right"), rover.rockers, strict=True)}
        if prim.GetName() in parts:
            expected = parts[prim.GetName()].inertia
            assert_close(inertia, expected, 1e-6 * np.abs(expected).max(), "kg m2", prim.GetName())
    assert_close(mass, rover.mass, 1e-6 * rover.mass, "kg", "the sum of the links")
    for i, wheel in enumerate(rover.wheel_names):
        at = cache.GetLocalToWorldTransform(stage.GetPrimAtPath(root.GetPath().AppendChild(f"wheel_{wheel}")))
        assert_close(np.array(at.ExtractTranslation()), rover.hubs[i], 1e-12, "m", wheel)
    joints = {prim.GetName(): prim for prim in stage.Traverse() if prim.IsA(UsdPhysics.RevoluteJoint)}
    assert len(joints) == 10 + rover.steers.sum()
    for prim in joints.values():
        joint = UsdPhysics.RevoluteJoint(prim)
        ends = []
        for body, offset in ((joint.GetBody0Rel(), joint.GetLocalPos0Attr()), (joint.GetBody1Rel(), joint.GetLocalPos1Attr())):
            (target,) = body.GetTargets()
            ends.append(np.array(cache.GetLocalToWorldTransform(stage.GetPrimAtPath(target)).Transform(offset.Get())))
        assert_close(ends[0], ends[1], 1e-6, "m", f"both ends of {prim.GetName()} meet at rest")
    follower = joints["rocker_right_joint"]
    assert {"PhysxMimicJointAPI:rotY", "NewtonMimicAPI"} <= set(follower.GetPrimTypeInfo().GetAppliedAPISchemas())
    for relation in ("physxMimicJoint:rotY:referenceJoint", "newton:mimicJoint"):
        assert follower.GetRelationship(relation).GetTargets() == [joints["rocker_left_joint"].GetPath()]
    gearing = follower.GetAttribute("physxMimicJoint:rotY:gearing").Get()
    slope = follower.GetAttribute("newton:mimicCoef1").Get()
    assert_close([-gearing, slope], rover.differential[[1, 1]], 1e-6, "-", "angle + gearing leader = 0; angle = coef1 leader")
    assert list(root.GetAttribute("rockerbogie:differential").Get()) == list(rover.differential)
