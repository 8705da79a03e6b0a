"""Makes the figures, tables and pictures of measured-impacts.md.

    .venv/bin/python -I docs/measured_impacts.py --ellipse CLONE --cubes FILE

CLONE is a clone of github.com/mcubelab/planar-impact-dataset. FILE is
a table of impacts of cubes, as ``python -m collision_response.identify --help`` describes it. Without an
argument, its figures in ``measured-impacts.json`` are kept.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import numpy as np
from figures import GREY, plt, save
from pages import rewrite, store, table

from collision_response import Body, Contact, Geometry, ImpactModel, Law, Precision, Twist
from collision_response.batch import contact_rows, resolve_batch
from collision_response.identify import Impacts, SphereReadings, identify
from collision_response.identify.from_table import impacts_from_rows, read_rows, readings_from_rows
from collision_response.identify.plot import draw
from collision_response.physics.vector import Vec3

HERE = Path(__file__).parent
PAGE, RESULTS, KHARAZ = HERE / "measured-impacts.md", HERE / "measured-impacts.json", HERE / "kharaz-2001.csv"
LAWS = [law for law in Law if law is not Law.AUTO]
SHOWN = 10, 50, 90
"""Percentiles of the impacts to show."""
BLUE, ORANGE = "#0072b2", "#d55e00"

SPEED, RADIUS = 3.9, 0.0025
BY_AUTHORS = {"restitution": 0.98, "friction": 0.092, "stiffness_ratio": 0.87}
"""The stiffness ratio is from Poisson's ratio 0.23, for the law that uses it."""
READING = {"ratio": 0.008, "angle": 0.84, "spin": 44.0}
SLIDING = 25.0
"""Incidence above which the sphere slides all the time [degrees]."""

MASS, GYRATION_SQUARED = 0.0364, 3.7e-4


def ellipse(clone: Path) -> Impacts:
    """Drops of an ellipse between two plates: planar, about z; up is y."""
    from scipy.io import loadmat

    data = loadmat(clone / "processed_data" / "data_ellipse.mat")["data"][0, 0]
    before, after = ([Twist(Vec3(vx, vy, 0.0), Vec3(0.0, 0.0, w)) for *_, vx, vy, w in data[name].tolist()]
                     for name in ("states_i", "states_f"))  # fmt: skip
    moment = MASS * GYRATION_SQUARED
    inertia = (moment, 0, 0, moment, 0, moment)
    bodies = [Body.dynamic(MASS, inertia, velocity=t.linear, angular_velocity=t.angular) for t in before]
    arms = zip(data["n"].tolist(), data["d"].tolist(), strict=True)
    contacts = [Contact.of((n[2], -d[2], 0.0), (0.0, 1.0, 0.0)) for n, d in arms]
    return Impacts.of(bodies, [Body.static()] * len(bodies), contacts, after, after)


MODELS = ("Drumwright-Shell", "AP Poisson", "AP Newton", "Mirtich", "Wang-Mason", "Whittaker")
ALIKE = {  # our law, its e and μ, and the model that it should agree with
    "MOREAU": (0.547, 0.079, "AP Newton"),
    "ROUTH_POISSON": (0.5467, 0.1192, "Wang-Mason"),
}


def of_models(clone: Path, drops: Impacts, laws: dict[str, Any]) -> dict[str, Any]:
    """Mean errors of the dataset's models and of our laws in the kinetic norm [m/s]; differences of pairs."""
    from scipy.io import loadmat

    columns = loadmat(clone / "processed_data" / "v_models.mat")["v_models"].T.reshape(6, 3, -1)
    weights = np.array([[1.0], [1.0], [GYRATION_SQUARED**0.5]])
    measured = drops.after[[0, 1, 5], 0]
    results: dict[str, Any] = {
        name: float(norms(weights * (told - measured)).mean())
        for name, told in zip(MODELS, columns, strict=True)
    }
    for name, one in laws.items():
        values = {key: value for key, (value, *_) in one["coefficients"].items()}
        told = drops.predict(Law[name], values)[[0, 1, 5], 0]
        results[name] = float(norms(weights * (told - measured)).mean())
    for name, (e, mu, other) in ALIKE.items():
        told = drops.predict(Law[name], {"restitution": e, "friction": mu})[:2, 0]
        apart = norms(told - columns[MODELS.index(other), :2]).mean()
        results[f"{name} less {other}"] = float(apart)
    return results


def norms(table: np.ndarray) -> np.ndarray:
    return np.sqrt((table**2).sum(axis=0))


def percentiles(values: np.ndarray) -> list[float]:
    return np.percentile(values, SHOWN).tolist()


def of_impacts(measured: Impacts) -> dict[str, Any]:
    """For each law the fit and the relative errors of the twists after the impacts; the rounding errors."""
    size = norms(measured.sizes("kinetic"))
    results: dict[str, Any] = {"impacts": len(measured), "laws": {}}
    for law in LAWS:
        found = identify(measured, law, resamples=100)
        off = norms(measured.residuals(law, found.values, "kinetic"))
        results["laws"][law.name] = {
            "coefficients": {name: list(one[:3]) for name, one in found.coefficients.items()},
            "misfit": float(np.linalg.norm(off) / np.linalg.norm(size)),
            "missed": percentiles(off / size),
        }
        print(found)
    results["rounding"] = percentiles(rounding(measured, results["laws"]["COULOMB"]["coefficients"]))
    return results


def rounding(measured: Impacts, coefficients: dict[str, list[float]]) -> np.ndarray:
    """Rounding errors of COULOMB in 64 bits, relative to the impulse, compared with EXTENDED."""
    rows, contacts = contact_rows(Geometry.SPATIAL), measured.contacts.copy()
    contacts[rows.restitution], contacts[rows.friction] = (
        coefficients[name][0] for name in ("restitution", "friction")
    )
    plain, exact = (
        resolve_batch(measured.bodies, contacts, ImpactModel(Law.COULOMB, precision=precision)).impulse
        for precision in (Precision.DOUBLE, Precision.EXTENDED)
    )
    return np.maximum(norms(plain - exact) / norms(exact), 2.0**-54)


def of_kharaz() -> dict[str, Any]:
    """Fits to the table of the paper, and errors of COULOMB with the authors' coefficients."""
    rows, _ = read_rows(KHARAZ, {})
    results: dict[str, Any] = {"impacts": len(rows), "fits": {}}
    sliding = [row for row in rows if row["incidence"] > SLIDING]
    for name in ("ratio", "angle", "spin", "all"):
        columns = ["ratio", "angle", "spin"] if name == "all" else [name]
        some = [{"incidence": row["incidence"], **{c: row[c] for c in columns}} for row in sliding]
        found = identify(readings_from_rows(some, SPEED, RADIUS, READING), loss="linear")
        results["fits"][name] = str(found).splitlines()[1:]
        print(name, found, sep="\n")
    angles, ratios = np.array([(row["incidence"], row["ratio"]) for row in rows if row["ratio"] > 0]).T
    results["angles"], results["measured"] = angles.tolist(), ratios.tolist()
    readings = SphereReadings(SPEED, RADIUS, {"ratio": [(a, 0.0) for a in angles]}, READING)
    off = {law.name: readings.predict(law, BY_AUTHORS) - ratios for law in LAWS}
    results["off"] = {name: one.tolist() for name, one in off.items()}
    missed = abs(off["COULOMB"]) * np.sin(np.radians(angles))
    results["missed"] = {
        "sliding": percentiles(missed[angles > SLIDING]),
        "sticking": percentiles(missed[angles < SLIDING]),
    }
    return results


def picture(results: dict[str, Any]) -> None:
    """Draw the errors from rounding and those of the laws on one axis."""
    cubes, drops, sphere = results["cubes"], results["ellipse"], results["kharaz"]["missed"]
    rows = [
        ("rounding in 64 bits: cubes", cubes["rounding"], BLUE),
        ("rounding in 64 bits: ellipse", drops["rounding"], BLUE),
        ("law: sphere, 30° to 60°", sphere["sliding"], ORANGE),
        ("law: sphere, below 25°", sphere["sticking"], ORANGE),
        ("law: corners of cubes", cubes["laws"]["COULOMB"]["missed"], ORANGE),
        ("law: drops of an ellipse", drops["laws"]["COULOMB"]["missed"], ORANGE),
    ]
    figure, axes = plt.subplots(figsize=(10, 3.6), layout="constrained")
    for y, (_, (low, middle, high), colour) in enumerate(rows):
        axes.plot([low, high], [y, y], color=colour, lw=6, alpha=0.35, solid_capstyle="butt")
        axes.plot(middle, y, "o", color=colour, ms=9)
        percent = f"{middle:.0e}" if middle < 1e-3 else f"{middle:.1%}"
        axes.annotate(
            percent, (middle, y), xytext=(0, 9), textcoords="offset points", ha="center", color=colour
        )
    axes.axvline(2.0**-20, color=GREY, ls=":", lw=1)
    axes.annotate("above this bound AUTO\ntakes more digits", (2.0**-20, 0.2), xytext=(6, 0), color=GREY,
                  textcoords="offset points", fontsize=9)  # fmt: skip
    axes.set(xscale="log", xlim=(1e-17, 3), ylim=(len(rows) - 0.5, -0.8), xlabel="relative error")
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows])
    save(figure, "measured-impacts.png")


MISSES = "law", "e", "μ", "misfit", "error per impact (10th, 50th, 90th percentile)"


def tables(results: dict[str, Any]) -> dict[str, str]:
    """The tables, by the name of their place in the page."""
    parts = {}
    for name in ("cubes", "ellipse"):
        rows = []
        for law, one in results[name]["laws"].items():
            told = [
                f"{value:.3g} [{low:.3g}, {high:.3g}]" for value, low, high in one["coefficients"].values()
            ]
            missed = ", ".join(f"{x:.0%}" for x in one["missed"])
            rows.append([f"`{law}`", *told, *[""] * (2 - len(told)), f"{one['misfit']:.1%}", missed])
        parts[name] = table(MISSES, rows)
    sphere = results["kharaz"]
    rows = [["measured", *(f"{x:.3f}" for x in sphere["measured"])]]
    rows += [[f"`{law}`", *(f"{x:+.3f}" for x in off)] for law, off in sphere["off"].items()]
    parts["sphere"] = table(["law", *(f"{a:.0f}°" for a in sphere["angles"])], rows)
    fits = [f"{name}\n" + "\n".join(lines) for name, lines in sphere["fits"].items()]
    parts["fits"] = "```text\n" + "\n".join(fits) + "\n```"
    return parts


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--ellipse", type=Path, metavar="CLONE")
    parser.add_argument("--cubes", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if arguments.ellipse:
        drops = ellipse(arguments.ellipse)
        results["ellipse"] = of_impacts(drops)
        results["models"] = of_models(arguments.ellipse, drops, results["ellipse"]["laws"])
    if arguments.cubes:
        cubes = impacts_from_rows(read_rows(arguments.cubes, {})[0])
        results["cubes"] = of_impacts(cubes)
        draw(identify(cubes), cubes, HERE / "images" / "identify.png")
    results["kharaz"] = of_kharaz()
    store(results, RESULTS)
    rewrite(PAGE, tables(results))
    picture(results)


if __name__ == "__main__":
    main()
