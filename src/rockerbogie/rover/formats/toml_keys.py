"""Table of all keys of a rover's TOML file.

The reader, the writer and the JSON schema use it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Key:
    """Key of a rover's TOML file, with the comment that explains it.

    `kind` is "text", "number", "bools" or an array shape like "3|2x3"; "per-wheel" is a number, 3 (axles) or 6 (wheels).
    """

    table: str
    name: str
    kind: str
    comment: str

    @property
    def path(self) -> str:
        """Return the key as `table.name`."""
        return f"{self.table}.{self.name}" if self.table else self.name


#: Purpose of each table, in the order of a file.
TABLES = {
    "": "A rover for rockerbogie. Body frame: x forward, y left, z up; every joint at its rest angle.",
    "wheels": "Wheels come in the order rocker wheel, middle wheel, the bogie's other wheel; each left, then right.",
    "linkage": "Positions of the joints and hubs. If only the left side is given, it is mirrored to the right.",
    "dh": "Instead of [linkage]: the constants of the Denavit-Hartenberg table of Elhami & Dashti.",
    "stops": "Joint limits; leave out a joint that has none. Nose down is positive; zero (rest) lies between them.",
    "differential": "The differential of the rockers. Left out: ideal, the right rocker turns by minus the left one's angle.",
    "body": "The body's own box, for its clearance above the terrain.",
    "mass": "The whole rover's mass, shared among its parts by a rule of thumb. Parts under [link] replace that.",
    "link": "One table a part: body, rocker_left, rocker_right, bogie_left, bogie_right, wheel_1 ... wheel_6 (wheel order).",
}

KEYS = (
    Key("", "format", "number", "version of this file's form; always 1"),
    Key("", "name", "text", "short name, used in messages and file names"),
    Key("", "title", "text", "title, one line"),
    Key("", "source", "text", "source of the numbers"),
    Key("", "grade", "text", "A: the maker's numbers; B: an independent model's; C: partly estimated"),
    Key("wheels", "radius_m", "per-wheel", "radius over the tread: a number, 3 (a pair each) or 6 (each wheel)"),
    Key("wheels", "width_m", "per-wheel", "width of the tread; 0 is a thin disc"),
    Key("wheels", "torque_n_m", "per-wheel", "torque limit of the hub motors, for the simulation; left out: not known"),
    Key("wheels", "steers", "bools", "which wheels steer: true or false, 3 (a pair each) or 6 (each wheel)"),
    Key("wheels", "names", "texts", "six short names in wheel order"),
    Key("linkage", "rocker_pivot_m", "3|2x3", "the rocker's pivot on the body"),
    Key("linkage", "bogie_pivot_m", "3|2x3", "the bogie's pivot on the rocker"),
    Key("linkage", "hubs_m", "3x3|6x3", "wheel centres: the rocker's, the middle one, the bogie's other one"),
    Key("linkage", "steering_offset_m", "2|3x2|6x2", "steering axis minus hub, x and y; 0 where the axis passes through the hub"),
    *(
        Key("dh", f"K{i}_{'deg' if i == 9 else 'm'}", "number", text)
        for i, text in enumerate(
            (
                "height of the differential over the body's reference point",
                "its distance ahead of it",
                "half the track",
                "differential to the rocker's steering axis, backwards",
                "differential down to the rocker wheel's axle",
                "length of the rocker from differential to bogie pivot",
                "bogie pivot to the bogie's other wheel, forwards",
                "bogie pivot down to its axles",
                "slope of the rocker's arm at rest",
                "wheel radius",
                "bogie pivot to the middle wheel, backwards",
            ),
            start=1,
        )
    ),
    Key(
        "stops",
        "rocker_deg",
        "2",
        "lowest and highest angle of the left rocker to the body; the right one follows from it",
    ),
    Key("stops", "bogie_deg", "2", "lowest and highest angle of each bogie to its rocker"),
    Key("differential", "ratio", "number", "the right rocker turns by minus this times the left one's angle"),
    Key("differential", "coefficients", "numbers", "or a polynomial in the left angle (rad), lowest power first: 0, -1, ..."),
    Key("differential", "bar_pivot_m", "2", "or a bar across the deck: x and z of its upright axis"),
    Key("differential", "bar_end_m", "3", "the bar's left end, at rest"),
    Key("differential", "horn_m", "3", "the point where the link from that end holds the left rocker, at rest"),
    Key("body", "box_m", "2x3", "lowest and highest corner"),
    Key("mass", "total_kg", "number", "the whole rover"),
    Key("link", "mass_kg", "number", "mass of the part"),
    Key("link", "com_m", "3", "its centre of mass, body frame, joints at rest"),
    Key("link", "inertia_kg_m2", "6", "xx, yy, zz, xy, xz, yz about its centre of mass, along the body's axes"),
)

#: The parts of a rover, as [link.NAME] tables name them, in the order of `Rover.links`.
LINKS = ("body", "rocker_left", "rocker_right", "bogie_left", "bogie_right", *(f"wheel_{i}" for i in range(1, 7)))
