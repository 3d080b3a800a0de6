"""`LENSES`, the table of lenses by name that everything else goes by, and the descriptions that users give.

The formulas are in decentred.py, radial.py and spheres.py.
"""

from __future__ import annotations

from orthoscope.geometry.arrays import InputError
from orthoscope.models.lenses.decentred import Brown, Rational
from orthoscope.models.lenses.free import FreeLens
from orthoscope.models.lenses.lens import Formula, Lens
from orthoscope.models.lenses.radial import Division, Fet, Fov, KannalaBrandt, Pfet, Stereographic
from orthoscope.models.lenses.spheres import DoubleSphere, Eucm

__all__ = [
    "FREE",
    "LENSES",
    "Brown",
    "Division",
    "DoubleSphere",
    "Eucm",
    "Fet",
    "Fov",
    "KannalaBrandt",
    "Pfet",
    "Rational",
    "Stereographic",
    "lens_name",
    "lens_with_values",
    "parse_lens",
]

# A formula with a displacement on top is no kind of its own, since it has a base; this is what it is called.
FREE = "free"

# Every formula by its name.
LENSES: dict[str, type[Formula]] = {
    "brown": Brown,
    "rational": Rational,
    "pfet": Pfet,
    "fet": Fet,
    "fov": Fov,
    "division": Division,
    "kannala_brandt": KannalaBrandt,
    "stereographic": Stereographic,
    "double_sphere": DoubleSphere,
    "eucm": Eucm,
}


def parse_lens(text: str) -> tuple[type[Formula], tuple[str, ...]]:
    """The lens of a description, and the coefficients that a calibration is to free.

    Args:
        text: such as `brown` or `brown:k1,k2`.
    Raises:
        InputError: a lens or a coefficient that is not there.
    """
    name, _, listed = text.strip().partition(":")
    if name == FREE:
        raise InputError(
            f"lens {FREE!r} is no formula; only the method decoupled fits it. Name a formula, such as brown,"
            " or leave --method out."
        )
    if name not in LENSES:
        raise InputError(
            f"lens {name!r} is not known; expected one of {', '.join(LENSES)}, as in --lens brown or --lens"
            " brown:k1,k2."
        )
    lens = LENSES[name]
    free = tuple(part.strip() for part in listed.split(",") if part.strip()) if listed else lens.free
    for coefficient in free:
        if coefficient not in lens.names():
            raise InputError(
                f"lens {name!r} has no coefficient {coefficient!r}; it has {', '.join(lens.names())}."
            )
    return lens, free


def lens_with_values(text: str) -> Formula:
    """The lens of a description with values.

    Args:
        text: such as `brown:k1=-0.3,k2=0.1`; coefficients that are not named keep their usual value.
    Raises:
        InputError: a lens, a coefficient or a value that is none.
    """
    name, _, listed = text.strip().partition(":")
    lens, _ = parse_lens(name)
    try:
        values = {
            key.strip(): float(value)
            for key, value in (part.split("=") for part in listed.split(",") if part.strip())
        }
    except ValueError as error:
        raise InputError(
            f"lens {text!r} is not understood; expected a name and values, such as brown:k1=-0.3,k2=0.1."
        ) from error
    return lens().with_coefficients(**values)


def lens_name(lens: Lens) -> str:
    """The name of a lens in LENSES, or `free`."""
    return (
        FREE
        if isinstance(lens, FreeLens)
        else next(name for name, kind in LENSES.items() if type(lens) is kind)
    )
