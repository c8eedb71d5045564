"""Models for the engine plugins, from a generator of random numbers: fair ones and mangled ones."""

ODD = (
    "nan", "inf", "-inf", "1e9", "1e308", "-1", "65536 65536", "", " ", "x" * 5000, "0", "1e-300",
    "2147483648", "-2147483649", "4294967297", "0.5", "true", "é" * 700, "1 2 3 4 5 6", "200001",
    "0 0 0 0", "1e-4", "10", "1000", "0x10", "1e9 1e9 1e9",
)  # fmt: skip
FLUID = {
    "spacing": (0.018, 0.018, 0.05, 1e-4, 10),
    "columns": ("3 3", "1 1", "200000 1", "1 200000", "65536 65536"),
    "corner": ("0 0 .1", "-.05 -.05 .2", "1e4 -1e4 1e4"),
    "viscosity": (0, 2e-4, 1e-3),
    "cohesion": (0, 2, 1000),
    "friction": (0, 0.01, 10),
    "density": (1000, 1e-6, 1e6),
    "substeps": (0, 1, 3, 3, 20),
    "two_way": ("true", "false"),
    "world": ("true", "false"),
    "flexes": ("true", "false"),
    "max_speed": (10, 0.01, 1000),
    "draw": ("surface", "fine", "particles", "none"),
    "rgba": ("1 0 0 1", "0 0 0 0"),
}
CLOTH = {
    "stretch": (1000, 1e-3, 1e6),
    "shear": (0.3, 1e-3, 1),
    "bend": (1e-5, 0, 1),
    "stretch_damping": (0, 1e-3, 1),
    "bend_damping": (0, 0.05, 1),
    "friction": (0, 0.75, 10),
    "drag": (0, 1.2, 100),
    "added_mass": (0, 0.01, 100),
    "contype": (1, 0, 1 << 30),
    "conaffinity": (1, 0, 1 << 30),
    "substeps": (1, 2, 5, 5, 25),
    "sweeps": (1, 2, 2, 15),
    "contact_stiffness": (2000, 1, 1e7),
    "contact_damping": (0, 0.01, 1),
}
SHAPES = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box")
SIZES = (0.01, 0.03, 0.1, 0.1, 0.3, 1.0)
ODD_SIZES = ("0", "-1", "nan", "inf", "1e-9", "1e-20", "1e6", "1e20", "1e308")
ODD_NUMBERS = ("nan", "inf", "1e9", "-2e10", "1e20", "1e308", "1e-300", "0")
ASSETS = """<asset>
<mesh name="mesh" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/>
<hfield name="field" nrow="3" ncol="3" size=".5 .5 .1 .1" elevation="0 1 0 1 0 1 0 1 0"/></asset>"""


def make_model(rng):
    return Maker(rng).model()


class Maker:
    """Draws the parts of a model; `odd` is the share of values that are none of the fair ones."""

    def __init__(self, rng):
        self.rng = rng
        self.odd = rng.choice([0, 0, 0, 0.01, 0.05, 0.3])

    def chance(self, share):
        return self.rng.random() < share

    def one_of(self, values):
        return values[self.rng.integers(len(values))]

    def value(self, fair, odd=ODD):
        return self.one_of(odd) if self.chance(self.odd) else fair

    def numbers(self, count, scale=0.2):
        numbers = [f"{x:.6g}" for x in self.rng.normal(size=count) * scale]
        if self.chance(self.odd):
            numbers[self.rng.integers(count)] = self.one_of(ODD_NUMBERS)
        return " ".join(numbers)

    def instance(self, name, attributes, share):
        keys = [k for k in attributes if self.chance(share) or k in ("substeps", "sweeps")]
        if self.chance(self.odd / 4):
            keys += [self.one_of((*attributes, "color", "")), *keys[:1]]
        config = "".join(
            f'<config key="{k}" value="{self.value(self.one_of(attributes.get(k, ODD)))}"/>'
            for k in keys
        )
        return f'<instance name="{name}">{config}</instance>'

    def extension(self):
        """Returns up to two instances of each plugin; stores their names."""
        self.waters = [f"water{i}" for i in range(self.rng.choice(3, p=[0.3, 0.55, 0.15]))]
        self.cloths = [f"cloth{i}" for i in range(self.rng.choice(3, p=[0.25, 0.6, 0.15]))]
        count = (1, 8, 27, 60, 150, 400)
        if self.chance(0.01):
            count = (2000, 8000)
        parts = ""
        if self.waters:
            fluid = "".join(
                self.instance(name, FLUID, 0.3).replace(
                    "</instance>",
                    f'<config key="count" value="{self.value(self.one_of(count))}"/></instance>',
                )
                for name in self.waters
            )
            parts += f'<plugin plugin="softgym_mj.fluid">{fluid}</plugin>'
        if self.cloths:
            cloth = "".join(self.instance(name, CLOTH, 0.3) for name in self.cloths)
            parts += f'<plugin plugin="softgym_mj.cloth">{cloth}</plugin>'
        return f"<extension>{parts}</extension>"

    def option(self):
        timestep = self.one_of(("0.01", "0.01", "0.01", "0.002", "0.05"))
        if self.chance(self.odd):
            timestep = self.one_of(
                ("1e-9", "1e-300", "0", "-1", "nan", "inf", "1", "1e4", "1e9", "1e308")
            )
        integrator = self.one_of(("Euler", "implicit", "implicitfast", "Euler"))
        if self.chance(0.3 if not self.cloths else 0.02):
            integrator = "RK4"
        gravity = self.numbers(3, 10) if self.chance(0.3) else "0 0 -9.81"
        flags = "".join(
            f' {name}="disable"' for name in ("contact", "spring", "damper") if self.chance(0.05)
        )
        extra = ' sleep="enable"' if self.chance(0.01) else ""
        return (
            f'<option timestep="{timestep}" integrator="{integrator}" gravity="{gravity}">'
            f'<flag warmstart="enable"{flags}{extra}/></option><size memory="8M"/>'
        )

    def geom(self, fixed=False):
        shape = self.one_of(SHAPES if fixed or self.chance(0.01) else SHAPES[1:])
        size = " ".join(
            str(self.one_of(ODD_SIZES) if self.chance(self.odd / 2) else self.one_of(SIZES))
            for _ in range(3)
        )
        kind = f'type="{shape}" size="{size}"'
        if self.chance(0.02):
            kind = self.one_of(('type="mesh" mesh="mesh"', 'type="hfield" hfield="field"'))
        ghost = ' contype="0" conaffinity="0"' if self.chance(0.3) else ""
        return (
            f'<geom {kind} pos="{self.numbers(3)}" euler="{self.numbers(3, 90)}" mass=".1"{ghost}/>'
        )

    def body(self, depth=0):
        joint = self.one_of(
            ("", "<freejoint/>", '<joint type="slide" axis="1 0 0"/>', '<joint type="ball"/>',
             '<joint axis="0 1 0" damping="1"/>', 'mocap')
        )  # fmt: skip
        mocap = ""
        if joint == "mocap" or (depth and joint == "<freejoint/>"):
            mocap, joint = ("" if depth else ' mocap="true"'), ""
        inside = "".join(self.geom() for _ in range(self.rng.integers(1, 4)))
        if depth < 2 and self.chance(0.2):
            inside += self.body(depth + 1)
        if self.cloths and self.chance(0.05):
            inside += self.flex()
        names = self.waters + (self.cloths if self.chance(0.02) else [])
        if names and self.chance(0.5):
            inside += f'<plugin instance="{self.one_of(names)}"/>'
        position = self.numbers(3)
        name = f"b{self.rng.integers(1 << 40)}"
        return f'<body name="{name}" pos="{position}"{mocap}>{joint}{inside}</body>'

    def flex(self):
        dim = int(self.rng.choice([1, 2, 3], p=[0.3, 0.65, 0.05]))
        carries = self.cloths and self.chance(0.85)
        radius = self.value(self.one_of((0.005, 0.005, 0.001, 0.02, 1e-9)), ODD_SIZES)
        mass = self.value(self.one_of((0.01, 0.1, 1e-6)), ODD_SIZES)
        name = f"f{self.rng.integers(1 << 40)}"
        if dim == 3 or self.chance(0.6):  # Flat tetrahedra crash MuJoCo itself.
            most = self.one_of((2, 4, 7, 12))
            count = [
                int(self.rng.integers(1 if self.chance(0.02) else 2, most + 1)) for _ in range(3)
            ]
            count[dim:] = [1] * (3 - dim)
            spacing = self.value(self.one_of((".05 .05 .05", ".06 .06 .06", ".3 .05 .1", "1 1 1")))
            shape = f'type="grid" count="{" ".join(map(str, count))}" spacing="{spacing}"'
        elif self.chance(0.15):
            shape = self.one_of(
                ('type="circle" count="9 1 1" spacing=".02 .02 .02"', 'type="disc" count="4 4 1" '
                 'spacing=".03 .03 .03"', 'type="box" count="3 3 3" spacing=".02 .02 .02"')
            )  # fmt: skip
        else:
            shape = f'type="direct" {self.points(dim)}'
        odd_dof = ' dof="trilinear"' if self.chance(0.03) else ""
        rigid = ' rigid="true"' if self.chance(0.02) else ""
        colliding = self.chance(0.03)
        contact = (
            'selfcollide="narrow"'
            if colliding
            else 'selfcollide="none" contype="0" conaffinity="0"'
        )
        inside = f'<contact {contact}/><edge damping="1e-12"/>'
        if carries:
            inside += f'<plugin instance="{self.one_of(self.cloths)}"/>'
        if self.chance(0.2):
            inside += f'<pin id="{self.rng.integers(3)}"/>'
        position = self.numbers(3)
        return (
            f'<flexcomp name="{name}" dim="{dim}" {shape} radius="{radius}" mass="{mass}" '
            f'pos="{position}" euler="{self.numbers(3, 40)}"{odd_dof}{rigid}>{inside}</flexcomp>'
        )

    def points(self, dim):
        """Points and elements, of which some coincide or have no length or area."""
        count = int(self.rng.integers(1 if self.chance(0.1) else 4, 10))
        x = self.rng.normal(size=(count, 3)) * self.one_of((0.05, 0.05, 1e-3, 1e-9, 1e4))
        kind = self.rng.integers(6)
        if kind == 0:
            x[:, 1:] = 0  # On a line.
        elif kind == 1:
            x[self.rng.integers(count)] = x[0]
        elif kind == 2:
            x[:] = x[0]
        elements = self.rng.integers(count, size=(self.rng.integers(1, 14), dim + 1))
        if self.chance(0.9) and count > dim:
            elements = [self.rng.permutation(count)[: dim + 1] for _ in elements]
        flat = " ".join(str(i) for e in elements for i in e)
        return f'point="{" ".join(f"{a:.9g}" for a in x.ravel())}" element="{flat}"'

    def model(self):
        extension = self.extension()
        parts = [self.body() for _ in range(self.rng.integers(0, 3))]
        parts += [self.geom(fixed=True) for _ in range(self.rng.integers(0, 3))]
        flexes = self.rng.integers(1, 4) if self.cloths else int(self.chance(0.2))
        parts += [self.flex() for _ in range(flexes)]
        for name in self.waters:
            if self.chance(0.7):
                walls = self.geom() + self.geom()
                parts.append(f'<body mocap="true">{walls}<plugin instance="{name}"/></body>')
        xml = (
            f"<mujoco>{self.option()}{extension}{ASSETS}"
            f"<worldbody>{''.join(parts)}</worldbody></mujoco>"
        )
        return self.mangled(xml) if self.chance(0.5 * self.odd) else xml

    def mangled(self, xml):
        """Without a piece, or with one twice."""
        start = int(self.rng.integers(len(xml)))
        end = start + int(10 ** self.rng.uniform(0, 3))
        return xml[:end] + xml[start:] if self.chance(0.5) else xml[:start] + xml[end:]
