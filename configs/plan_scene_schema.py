"""Schema of scene files; `plan_scene` builds the planner's objects from it."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from ..planner.log.log_json import SIZES

TAGS = ("~text", "~list", "~table")
Point = Annotated[list[float], Field(min_length=3, max_length=3)]
Quaternion = Annotated[list[float], Field(min_length=4, max_length=4)]
PoseVector = Annotated[list[float], Field(min_length=7, max_length=7)]


def _refused(key: str, text: str) -> PydanticCustomError:
    return PydanticCustomError("refused", "{text}", {"key": key, "text": text})


def _form(value: Any) -> str:
    return "~text" if isinstance(value, str) else "~list" if isinstance(value, list) else "~table"


def _either(text: str) -> Discriminator:
    return Discriminator(_form, custom_error_type="form", custom_error_message=f"must be {text}")


class Strict(BaseModel):
    """A table without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    @model_validator(mode="before")
    @classmethod
    def _know_every_key(cls, values: Any) -> Any:
        allowed = list(cls.model_fields)
        for key in values if isinstance(values, dict) else ():
            if key not in allowed:
                close = get_close_matches(str(key), allowed, n=1)
                hint = f"did you mean {close[0]!r}? " if close else ""
                raise _refused(str(key), f"unknown key; {hint}allowed: {', '.join(allowed)}")
        return values


class Placed(Strict):
    """A pose.

    Attributes:
        position: (3,) position [m].
        quaternion: (4,) rotation, wxyz.
        rpy_degrees: roll, pitch and yaw about the fixed axes x, y and z, in this order; [180, 0, yaw] points down.
        yaw_degrees: yaw about z of an upright pose.
    """

    position: Point
    quaternion: Quaternion | None = None
    rpy_degrees: Point | None = None
    yaw_degrees: float | None = None

    @model_validator(mode="after")
    def _one_attitude(self) -> Placed:
        given = [key for key in ("quaternion", "rpy_degrees", "yaw_degrees") if getattr(self, key) is not None]
        if len(given) > 1:
            raise _refused(given[1], f"cannot stand beside {given[0]!r}: one of them is enough")
        return self


class ShapeFields(Strict):
    """A shape: radius for a sphere, radius and length for capsule and cylinder, size for a box, vertices for a mesh.

    Attributes:
        shape: kind of the shape.
        radius: radius [m].
        length: length [m], of a capsule without its caps.
        size: (3,) full extents [m].
        vertices: (n, 3) vertices [m]; the shape is their convex hull.
    """

    shape: Literal["sphere", "capsule", "box", "cylinder", "mesh"]
    radius: float | None = None
    length: float | None = None
    size: Point | None = None
    vertices: list[Point] | None = None

    @model_validator(mode="after")
    def _its_own_sizes(self) -> ShapeFields:
        wanted = SIZES[self.shape]
        for key in ("radius", "length", "size", "vertices"):
            if key in wanted and getattr(self, key) is None:
                raise _refused(key, f"is missing; a {self.shape} has {' and '.join(wanted)}")
            if key not in wanted and getattr(self, key) is not None:
                raise _refused(key, f"a {self.shape} has none; it has {' and '.join(wanted)}")
        return self


class ObstacleItem(ShapeFields, Placed):
    """An obstacle: a shape, its pose, and further fields of the planner's `Obstacle`.

    Attributes:
        velocity: (3,) velocity of its center in the world [m/s].
        margin: safety distance to this obstacle [m]; None: the general one.
        name: name for messages and allowed pairs.
    """

    velocity: Point = [0.0, 0.0, 0.0]
    margin: float | None = None
    name: str = ""


class HeldItem(ShapeFields):
    """An object in the hand.

    Attributes:
        name: name for messages and allowed pairs.
        tcp_from_object: pose of the object in the tcp frame.
    """

    name: str = "held"
    tcp_from_object: Placed


class RobotFile(Strict):
    """An arm from a URDF or MJCF file.

    Attributes:
        urdf: URDF file.
        mjcf: MJCF file, instead.
        tool: name of the tool frame: a link or joint of a URDF, a site or body of an MJCF file.
        tcp_frame: the same; a former name of the key.
        velocity_limits: largest joint speeds [rad/s or m/s], one number or one per joint; None: those of the URDF.
        base: pose of a URDF's root link in the world; None: the origin.
        base_link: link, or body, where the arm begins: joints before it are held; None: the root.
        locked: positions of joints to hold [rad or m], by name or shell pattern.
        package_dirs: folders of the packages of a URDF's package://; None: the folders above the file.
        srdf: SRDF file with pairs of links that are not checked against each other.
        visuals: cover links without collision geometry by their visual geometry.
    """

    urdf: str | None = None
    mjcf: str | None = None
    tool: str | None = None
    tcp_frame: str | None = None
    velocity_limits: (
        Annotated[
            Annotated[float, Tag("~table")] | Annotated[list[float], Tag("~list")],
            _either("a number, or a list of one per joint"),
        ]
        | None
    ) = None
    base: Placed | None = None
    base_link: str | None = None
    locked: dict[str, float] = Field(default_factory=dict)
    package_dirs: list[str] | None = None
    srdf: str | None = None
    visuals: bool = False

    @model_validator(mode="after")
    def _one_file_and_one_tool(self) -> RobotFile:
        for first, second in (("urdf", "mjcf"), ("tool", "tcp_frame")):
            given = [key for key in (first, second) if getattr(self, key) is not None]
            if not given:
                raise _refused(first, f"is missing; it may also be {second}")
            if len(given) == 2:
                raise _refused(second, f"cannot stand beside {first!r}: one of them is enough")
        if self.mjcf is not None and self.velocity_limits is None:
            raise _refused("velocity_limits", "is missing: MJCF has no speeds")
        for key in ("base", "package_dirs") if self.mjcf is not None else ():
            if getattr(self, key) is not None:
                raise _refused(key, "is for a URDF; an MJCF file says it itself")
        return self


class Recorded(Strict):
    """A recorded demonstration.

    Attributes:
        file: name of a shipped demonstration, or a file.
        segment: name of one segment; None: the whole demonstration.
    """

    file: str
    segment: str | None = None


class SceneConfig(Strict):
    """A motion to plan.

    Attributes:
        title: title of pictures.
        robot: robosuite's name, or a URDF or MJCF file.
        demonstration: a recording, or pose vectors (x y z [m], then quaternion wxyz) joined by screw motions.
        start: start joints [rad or m], or "home".
        goal: goal pose of the tcp, as a pose vector or a table.
        obstacles: obstacles in the world.
        held: object in the hand, or None.
        allowed: pairs of a part of the body (or a held object) and an obstacle that may touch, but for 5 mm no deeper
            than at the ends of the motion.
        settings: settings of the planner, nested; see `PlanSettings`.
        seed: seed of the planner's random choices.
    """

    title: str = ""
    robot: Annotated[
        Annotated[str, Tag("~text")] | Annotated[RobotFile, Tag("~table")],
        _either("a robot's name, or a table of urdf (or mjcf) and tool"),
    ] = "Panda"
    demonstration: Annotated[
        Annotated[Annotated[list[PoseVector], Field(min_length=1)], Tag("~list")] | Annotated[Recorded, Tag("~table")],
        _either("a list of pose vectors, or a table of file and segment"),
    ]
    start: Annotated[
        Annotated[Literal["home"], Tag("~text")] | Annotated[list[float], Tag("~list")],
        _either("a list of joints, or home"),
    ] = "home"
    goal: Annotated[
        Annotated[PoseVector, Tag("~list")] | Annotated[Placed, Tag("~table")],
        _either("a pose vector, or a table of position and attitude"),
    ]
    obstacles: list[ObstacleItem] = Field(default_factory=list)
    held: HeldItem | None = None
    allowed: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(default_factory=list)
    settings: dict[str, Any] = Field(default_factory=dict)
    seed: Annotated[int, Field(ge=0, le=2**31)] = 0


def checked(values: dict[str, Any]) -> SceneConfig | tuple[str, str]:
    """Return the config, or the key of the first error and its reason."""
    try:
        return SceneConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
    context = first.get("ctx", {})
    parts = [part for part in first["loc"] if part not in TAGS]
    if first["type"] == "refused":
        return _key([*parts, context["key"]]), context["text"]
    if first["type"] == "missing":
        return _key(parts), "is missing"
    got = repr(first["input"])
    got = got if len(got) <= 60 else f"{got[:57]}..."
    return _key(parts), f"{first['msg'][0].lower()}{first['msg'][1:]}, got {got}"


def _key(parts: list[Any]) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts)
    return text.removeprefix(".")
