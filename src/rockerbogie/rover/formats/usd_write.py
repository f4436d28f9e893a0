"""USD writer: an articulation for Isaac Sim and other programs that read UsdPhysics."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ...arrays import Array
from ...errors import RoverError, require
from ...files.version import __version__
from ..model import Rover
from .export_tree import tree_of
from .tree import Joint, Part

#: Drives by kind of joint: stiffness (1/s²) and damping (1/s) of an acceleration drive, which fits every mass. Steering is driven
#: to an angle, wheels to a rate.
DRIVES = {"steer": (900.0, 60.0), "wheel": (0.0, 60.0)}
AXES = "XYZ"


def to_usd(rover: Rover) -> str:
    """Return the rover as USD text, with UsdPhysics joints, masses and collision shapes.

    The root has an articulation. The right rocker's joint has the differential as `PhysxMimicJointAPI` and as `NewtonMimicAPI`:
    right = slope · left, without compliance. A differential that is not a plain ratio is written as its slope at rest, and in
    full in the attribute `rockerbogie:differential`. Steering joints have a drive to an angle, wheels a drive to a rate.

    Args:
        rover: the rover to write.

    Returns:
        Text of a .usda file (also readable as .usd), metres, kilograms, z up.

    Raises:
        RoverError: not a rover, or usd-core is not installed.
    """
    tree = tree_of(rover)
    require("writing USD", "usd", "pxr", error=RoverError)
    from pxr import Sdf, Usd, UsdGeom, UsdPhysics

    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().comment = f"rockerbogie {__version__}"
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, f"/{_identifier(rover.name)}").GetPrim()
    stage.SetDefaultPrim(root)
    UsdPhysics.ArticulationRootAPI.Apply(root)
    # treads may overlap the body's box, which stands for the payload
    root.AddAppliedSchema("PhysxArticulationAPI")
    root.CreateAttribute("physxArticulation:enabledSelfCollisions", Sdf.ValueTypeNames.Bool).Set(False)
    root.CreateAttribute("rockerbogie:differential", Sdf.ValueTypeNames.DoubleArray).Set(list(map(float, rover.differential)))
    rest = tree.rest()
    paths = {name: root.GetPath().AppendChild(_identifier(name)) for name in tree.parts}
    for name, part in tree.parts.items():
        _add_link(stage, paths[name], part, rest[name][:3, 3])
    scope = UsdGeom.Scope.Define(stage, root.GetPath().AppendChild("joints")).GetPath()
    for joint in tree.joints.values():
        _add_joint(stage, scope, joint, paths)
    return str(stage.GetRootLayer().ExportToString())


def _add_link(stage: Any, path: Any, part: Part, at: Array) -> None:
    """Add a link at its position at rest, with its mass properties and shapes."""
    from pxr import Gf, UsdGeom, UsdPhysics

    link = UsdGeom.Xform.Define(stage, path)
    link.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, at)))
    UsdPhysics.RigidBodyAPI.Apply(link.GetPrim())
    moments, turn = np.linalg.eigh(part.inertia)
    turn = turn * np.sign(np.linalg.det(turn))
    mass = UsdPhysics.MassAPI.Apply(link.GetPrim())
    mass.CreateMassAttr(float(part.mass))
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*map(float, part.com)))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*map(float, moments)))
    mass.CreatePrincipalAxesAttr(Gf.Quatf(Gf.Matrix3d(*map(float, turn.T.ravel())).ExtractRotation().GetQuat()))
    for shape in part.shapes:
        place = path.AppendChild(_identifier(shape.name))
        if shape.kind == "box":
            geometry = UsdGeom.Cube.Define(stage, place)
            geometry.CreateSizeAttr(1.0)
            geometry.CreateExtentAttr([(-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)])
        else:
            radius, length = map(float, shape.size)
            geometry = UsdGeom.Cylinder.Define(stage, place)
            geometry.CreateAxisAttr(UsdGeom.Tokens.y)
            geometry.CreateRadiusAttr(radius)
            geometry.CreateHeightAttr(length)
            corner = (radius, length / 2, radius)
            geometry.CreateExtentAttr([tuple(-c for c in corner), corner])
        geometry.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, shape.T[:3, 3])))
        if shape.kind == "box":
            geometry.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*map(float, shape.size)))
        UsdPhysics.CollisionAPI.Apply(geometry.GetPrim())


def _add_joint(stage: Any, scope: Any, joint: Joint, paths: dict[str, Any]) -> None:
    """Add a hinge about y or z, with its limits, its drive or its mimic."""
    from pxr import Gf, Sdf, UsdPhysics

    hinge = UsdPhysics.RevoluteJoint.Define(stage, scope.AppendChild(_identifier(joint.name)))
    hinge.CreateBody0Rel().SetTargets([paths[joint.parent]])
    hinge.CreateBody1Rel().SetTargets([paths[joint.child]])
    axis = AXES[int(np.argmax(np.abs(joint.axis)))] if joint.axis is not None else AXES[0]
    hinge.CreateAxisAttr(axis)
    hinge.CreateLocalPos0Attr(Gf.Vec3f(*map(float, joint.T[:3, 3])))
    hinge.CreateLocalPos1Attr(Gf.Vec3f(0.0))
    hinge.CreateLocalRot0Attr(Gf.Quatf(1.0))
    hinge.CreateLocalRot1Attr(Gf.Quatf(1.0))
    low, high = joint.limits or (-np.inf, np.inf)
    if np.isfinite(low):
        hinge.CreateLowerLimitAttr(float(np.degrees(low)))
    if np.isfinite(high):
        hinge.CreateUpperLimitAttr(float(np.degrees(high)))
    prim = hinge.GetPrim()
    drive = DRIVES.get(joint.child.partition("_")[0])
    if drive is not None:
        motor = UsdPhysics.DriveAPI.Apply(prim, "angular")
        motor.CreateTypeAttr("acceleration")
        motor.CreateStiffnessAttr(drive[0])
        motor.CreateDampingAttr(drive[1])
    if joint.mimic is not None:
        leader, (offset, slope) = joint.mimic
        target = scope.AppendChild(_identifier(leader))
        token, number = Sdf.ValueTypeNames.Token, Sdf.ValueTypeNames.Float
        physx = f"physxMimicJoint:rot{axis}"
        prim.AddAppliedSchema(f"PhysxMimicJointAPI:rot{axis}")  # angle + gearing · leader + offset = 0
        prim.CreateRelationship(f"{physx}:referenceJoint", custom=False).SetTargets([target])
        prim.CreateAttribute(f"{physx}:referenceJointAxis", token, custom=False).Set(f"rot{axis}")
        for name, value in (("gearing", -slope), ("offset", -np.degrees(offset)), ("naturalFrequency", 0), ("dampingRatio", 0)):
            prim.CreateAttribute(f"{physx}:{name}", number, custom=False).Set(float(value) + 0.0)
        prim.AddAppliedSchema("NewtonMimicAPI")  # angle = coef0 + coef1 · leader
        prim.CreateRelationship("newton:mimicJoint", custom=False).SetTargets([target])
        for name, value in (("Coef0", np.degrees(offset)), ("Coef1", slope)):
            prim.CreateAttribute(f"newton:mimic{name}", number, custom=False).Set(float(value) + 0.0)


def _identifier(name: str) -> str:
    """Return a name as USD allows it: letters, digits and underscores, not a digit first."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return plain if plain and not plain[0].isdigit() else f"_{plain}"
