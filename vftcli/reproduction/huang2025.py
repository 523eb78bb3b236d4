"""Huang et al. 2025: every table and figure, what it prints, and the experiment that stands for it.

A verdict and a reason say what the full run gave; docs/reproduction.md holds it, and a test holds
that document to the code.
"""

from functools import partial

from vftcli.evaluation.print_table import TABLE_1
from vftcli.observers import PAPER
from vftcli.reproduction import circle, control, sensor
from vftcli.reproduction.benchmark import PAPER_TABLE_2
from vftcli.reproduction.paper import (
    AS_PRINTED,
    CORRECTED,
    DISCRETE,
    Experiment,
    Paper,
    PaperItem,
    PrintedLine,
)
from vftcli.reproduction.timing import computing_time
from vftcli.signals.wrench import AXES

NAMES = {"fdo": "FDO", "gmo": "GMO", "kfo-fe": "KFO-FE", "kfo-zoh": "KFO-ZOH"}
"""Observer → what the paper calls it."""

NUMBERS = {"fdo": "1", "gmo": "6", "kfo-fe": "18", "kfo-zoh": "18"}
"""Numbers to tune: 1, n and 3n."""

DRIFT = ("-0.43166", "-0.53348", "0.83768", "-0.16294", "0.13407", "0.09103")
"""Zero drift of the virtual sensor on the unloaded Panda, Sec. IV-D. [N, N·m]"""

XI_1 = "ξ = 1"

EXPERIMENTS = {
    "drag": Experiment("the UR5 dragged, controller in the loop (ur5-drag)", control.drag),
    "twist": Experiment("the UR5 twisted, controller in the loop (ur5-twist)", control.twist),
    "bearing": Experiment("the Panda and the bearing (panda-bearing)", sensor.assembled_bearing),
    "circle": Experiment(
        f"the circle, tapped ({circle.SCENARIO})", circle.tapped_circle, (5, 1, 2, 3, 4)
    ),
    "sensor": Experiment("the UR5 dragged by a sensor (ur5-sensor)", sensor.dragged_sensor),
    "release-ur5": Experiment(
        "a release of the UR5 from 0.3 m",
        partial(control.released, "ur5", 0, 0.3, control.ALPHAS),
        (0,),
    ),
    "release-panda": Experiment(
        "a release of the Panda from 0.2 m", partial(control.released, "panda", 0, 0.2, ()), (0,)
    ),
    "time": Experiment("computing time", computing_time, (0,), alone=True),
}
"""The longest first: two processes then end at about the same time."""


def each(
    key: str, label: str, unit: str = "", printed: tuple[str, ...] = ()
) -> tuple[PrintedLine, ...]:
    """A line for every observer; what counts beside the print has no unit."""
    numbers = printed or ("",) * len(PAPER)
    return tuple(
        PrintedLine(f"{key}/{name}", f"{NAMES[name]}: {label}", unit, number, not unit)
        for name, number in zip(PAPER, numbers, strict=True)
    )


def picture(label: str, title: str, why: str) -> PaperItem:
    """An item that holds no numbers."""
    return PaperItem(label=label, title=title, why=why, verdict="a picture")


def parameters(
    rows: dict[str, tuple[str, ...]], axes: tuple[str, ...] = ("x", "z", "rx")
) -> tuple[PrintedLine, ...]:
    """The lines of Table III or IV: printed numbers of these axes, those of the robot's file."""
    units = {
        "mass": ("kg", "kg·m²"),
        "damping": ("N·s/m", "N·m·s/rad"),
        "stiffness": ("N/m", "N·m/rad"),
        "threshold": ("N", "N·m"),
        "speed_limit": ("m/s", "rad/s"),
    }
    words = {"mass": "M_d", "damping": "B_d", "stiffness": "K_d", "alpha": "α"}
    words |= {"threshold": "F_tsd", "speed_limit": "speed limit", "xi": "ξ"}
    return tuple(
        PrintedLine(
            f"{key}/{axis}",
            f"{words[key]}, {axis}",
            units.get(key, ("", ""))[axis.startswith("r")],
            number,
        )
        for key, numbers in rows.items()
        for axis, number in zip(axes, numbers, strict=True)
    )


def returns(alphas: tuple[str, ...]) -> tuple[PrintedLine, ...]:
    """How a release from rest returns."""
    named = {"traditional": "traditional", **{alpha: f"α {alpha}" for alpha in alphas}}
    return tuple(
        PrintedLine(f"{key}/{name}", f"{words}: {label}", unit)
        for key, words, unit in (
            ("return_10_s", "back to 10 %", "s"),
            ("return_2_s", "back to 2 %", "s"),
            ("overshoot", "overshoot", "%"),
        )
        for name, label in named.items()
    )


def latency_lines(motion: tuple[str, str], withdrawal: tuple[str, str]) -> tuple[PrintedLine, ...]:
    """Latencies of both contacts."""
    return tuple(
        PrintedLine(
            f"{key}/{k}", f"{words}, phase {'I' * k}", "s", numbers[k - 1] if numbers else ""
        )
        for key, words, numbers in (
            ("detection", "true force over the threshold to estimate over it", ()),
            ("motion", "force to motion (5 mm, 0.02 rad)", motion),
            ("withdrawal", "force gone to estimate gone", withdrawal),
        )
        for k in (1, 2)
    )


def comparison_lines(advance: str) -> tuple[PrintedLine, ...]:
    """Figs. 7 and 10: α against traditional on one force record."""
    alphas = [f"{alpha:g}" for alpha in control.ALPHAS]
    lines = [
        PrintedLine(f"{key}/{alpha}/{k}", f"{words}, α {alpha}, phase {'I' * k}", "s", number)
        for key, words, wanted, number in (
            ("peak", "peak of the whole drag earlier by", ["1.9"], advance),
            ("turn", "turn after the last release earlier by", ["1.9"], advance),
            ("back", "back to 10 % after the release", alphas, ""),
        )
        for alpha in wanted
        for k in (1, 2)
    ]
    before = [
        PrintedLine(f"back/traditional/{k}", f"back to 10 %, traditional, phase {'I' * k}", "s")
        for k in (1, 2)
    ]
    return (*lines, *before)


SEVERAL = (AS_PRINTED, CORRECTED, DISCRETE)

ITEMS = {
    "table1": PaperItem(
        label="Table I",
        title="RMSE of the observers on the tapped circle",
        verdict="in size; KFO wins with R discrete only",
        why="The pushes behind the print are not known, those here are chosen near its level; "
        "FDO and GMO of equal gain are one filter, so the print's difference on J4 to J6 "
        "is not the method's, and KFO wins J1 to J3 only where R and Q_p are read as "
        "covariances of samples.",
        experiments=("circle",),
        nearest=DISCRETE,
        variants=(AS_PRINTED, CORRECTED, DISCRETE, circle.EQUAL),
        lines=tuple(
            PrintedLine(f"{name}/{j}", f"{NAMES[name]}, J{j}", "N·m", f"{number:.4f}")
            for name, numbers in TABLE_1.rmse.items()
            for j, number in enumerate(numbers, start=1)
        ),
    ),
    "table2": PaperItem(
        label="Table II",
        title="Computing time of 30 060 observations of a UR5",
        verdict="yes, the ratios",
        why="As printed is a literal script, sample by sample, with the zero-order hold's matrices "
        "made anew at each; its ratios are the print's, its times this machine's. Corrected keeps "
        "the constant matrices and works on whole columns: the zero-order hold costs nothing more.",
        experiments=("time",),
        nearest=AS_PRINTED,
        lines=(
            *each("seconds", "time", "s", tuple(f"{PAPER_TABLE_2[n]:g}" for n in PAPER)),
            PrintedLine("zoh/fdo", "KFO-ZOH over FDO", "", f"{58.3627 / 10.8690:.2f}"),
            PrintedLine("zoh/kfo-fe", "KFO-ZOH over KFO-FE", "", f"{58.3627 / 17.5776:.2f}"),
        ),
    ),
    "guidelines": PaperItem(
        label="Guidelines",
        title="Which observer for what (Sec. IV-A)",
        verdict="partly: they turn with the gains",
        nearest=AS_PRINTED,
        why="Gains decide: with densities FDO sees a step soonest and errs least, with "
        "covariances of samples KFO does both and lets most noise pass; at one bandwidth "
        "FDO and GMO are one filter, and KFO, of second order, lags and errs more.",
        experiments=("circle", "time"),
        variants=(AS_PRINTED, CORRECTED, DISCRETE, circle.EQUAL),
        lines=(
            *each("rmse", "RMSE, mean of joints", "N·m"),
            *each("response", "90 % of a step seen after, slowest joint", "s"),
            *each("delay", "delay behind a ramp, slowest joint", "s"),
            *each("passed", "noise above 5 Hz that passes", "%"),
            *each("numbers", "numbers to tune", "", tuple(NUMBERS[name] for name in PAPER)),
            *each("cost", "time of one observation", "µs", ("361.5", "350.6", "584.7", "1941.5")),
        ),
    ),
    "fig1": picture("Fig. 1", "Experimental equipment for the UR5", "A photograph."),
    "fig2": picture(
        "Fig. 2", "Free cycle and tapped cycle", "Photographs; the scenario of Table I is theirs."
    ),
    "fig3": PaperItem(
        label="Fig. 3",
        title="Torque of the observers over the current difference",
        verdict="in kind",
        why="The print shows curves without numbers: estimates that follow from the second cycle "
        "on and wander about zero in the first, FDO and GMO behind KFO on J3. The last holds only "
        "where R is read as a covariance of samples.",
        experiments=("circle",),
        variants=(AS_PRINTED, CORRECTED, DISCRETE, circle.EQUAL),
        lines=(
            *each("lag", "lag behind the reference, mean of J1 to J3", "s"),
            *each("free", "rms in the free cycle, J1 to J3", "N·m"),
        ),
        drawn=True,
    ),
    "fig4": PaperItem(
        label="Fig. 4",
        title="Virtual against real sensor, UR5, flange axes: RMSE",
        verdict="partly: not every axis within the bound",
        why="Inside are f_x, f_z and m_z; what is left is stiction of joints that stand still "
        "and the error of the profile, and the print blames the sensor's own weight too, "
        "which a zero does not take off in every pose.",
        experiments=("sensor",),
        variants=(AS_PRINTED, CORRECTED, sensor.ZEROED, DISCRETE),
        lines=tuple(
            PrintedLine(axis, axis, *(("N", "< 6") if k < 3 else ("N·m", "< 0.65")))
            for k, axis in enumerate(AXES)
        ),
        drawn=True,
    ),
    "table3": PaperItem(
        label="Table III",
        title="Parameters for the UR5, and a release from 0.3 m",
        verdict="yes, the parameters",
        why="ξ and a speed limit in rotation are not printed (ξ is that of B_d; without the "
        "limit a release runs away), and no time is; the printed law and the corrected one "
        "are the same here, times go with 1/α, without a break at 1.6.",
        experiments=("release-ur5",),
        variants=(CORRECTED, XI_1),
        lines=(
            *parameters(
                {
                    "mass": ("3", "0.1"),
                    "damping": ("5", "0.3"),
                    "stiffness": ("8", "0.5"),
                    "alpha": ("1.6", "1.6"),
                    "threshold": ("20", "6"),
                    "speed_limit": ("0.9", ""),
                    "xi": ("", ""),
                },
                ("x", "rx"),
            ),
            *returns(("1", "1.3", "1.6", "1.9")),
        ),
    ),
    "fig5": picture("Fig. 5", "The UR5 dragged by hand", "Photographs."),
    "fig6": PaperItem(
        label="Fig. 6",
        title="Position control in the loop: latencies",
        verdict="reproduced in size",
        why="How R and Q_p are read decides the sensor's delay, and that is the loop's: as "
        "printed the loop is twice as slow as the print says, with densities it is at the "
        "print; a motion that begins while the arm still drifts is left out (–).",
        experiments=("drag",),
        variants=SEVERAL,
        lines=latency_lines(("0.24", "0.28"), ("0.26", "0.12")),
        drawn=True,
    ),
    "fig7": PaperItem(
        label="Fig. 7",
        title="One force record, traditional and α 1 to 1.9",
        verdict="no: not like for like",
        why="All controllers see the same record, and of it what is above the threshold; after "
        "the last release α 1.9 turns round 0.1 s earlier (0.2 s as printed), not 0.64 s, "
        "and the whole drag's peak comes more than that earlier where the record dips "
        "below the threshold meanwhile, which lets the variable controller return; time "
        "back goes on falling with α beyond 1.6.",
        experiments=("drag",),
        variants=SEVERAL,
        lines=comparison_lines("0.64"),
        drawn=True,
    ),
    "fig8": picture("Fig. 8", "The UR5 twisted by hand", "Photographs."),
    "fig9": PaperItem(
        label="Fig. 9",
        title="Orientation control in the loop: latencies",
        verdict="reproduced in size",
        why="As for Fig. 6: as printed four times the print, with densities a third above it, "
        "with covariances of samples half of it.",
        experiments=("twist",),
        variants=SEVERAL,
        lines=latency_lines(("0.16", "0.16"), ("0.16", "0.12")),
        drawn=True,
    ),
    "fig10": PaperItem(
        label="Fig. 10",
        title="One moment record, traditional and α 1 to 1.9",
        verdict="no: not like for like",
        why="As for Fig. 7: after the last release the turn comes 0.13 s earlier, not 0.32 s; "
        "a larger advance of the whole drag's peak comes from dips of the record.",
        experiments=("twist",),
        variants=SEVERAL,
        lines=comparison_lines("0.32"),
        drawn=True,
    ),
    "table4": PaperItem(
        label="Table IV",
        title="Parameters for the Panda, and a release from 0.2 m",
        verdict="yes, the parameters",
        why="As for Table III; B_d is 2.7 times critical, so that ξ = 1 returns four times sooner.",
        experiments=("release-panda",),
        variants=(CORRECTED, XI_1),
        lines=(
            *parameters(
                {
                    "mass": ("40", "40", "4"),
                    "damping": ("120", "120", "6"),
                    "stiffness": ("12", "12", "2"),
                    "alpha": ("6", "6", "3"),
                    "threshold": ("4", "15", "2"),
                    "speed_limit": ("0.9", "0.9", ""),
                    "xi": ("", "", ""),
                }
            ),
            *returns(("6",)),
        ),
    ),
    "fig11": picture("Fig. 11", "Equipment for the Panda, bearing assembly", "Photographs."),
    "fig12": PaperItem(
        label="Fig. 12",
        title="Virtual sensor and libfranka, Panda with bearing",
        verdict="reproduced",
        why="The drift is that of the simulated arm's errors, not of the paper's arm; with it "
        "removed the bearing weighs what it weighs, within what stiction lets through. The floor "
        "is the simulated libfranka's own reading, and its own error beside the truth.",
        experiments=("bearing",),
        lines=(
            *(
                PrintedLine(
                    f"drift/{axis}", f"zero drift, {axis}", "N" if k < 3 else "N·m", DRIFT[k], False
                )
                for k, axis in enumerate(AXES)
            ),
            PrintedLine("weight/raw", "bearing, drift in it (9.2 N)", "N", "10.5"),
            PrintedLine("weight/zeroed", "bearing, drift removed (9.2 N)", "N", "9.66"),
            PrintedLine("error/guided", "error of the force, guided", "N"),
            PrintedLine("error/pressed", "error of the force, pressed", "N"),
            PrintedLine("error/knocked", "error of the force, knocked", "N"),
            PrintedLine("agreement", "correlation with libfranka, F_z", ""),
        ),
        drawn=True,
    ),
    "fig13": PaperItem(
        label="Fig. 13",
        title="The Panda's motion, variable and traditional",
        verdict="reproduced in kind",
        why="The print shows curves without numbers: the variable controller is back before the "
        "bearing is let go, the traditional one (–) not before the record ends, and knocks below "
        "the threshold move the arm by less than a millimetre. Control at 2.5 ms or at the "
        "sampling's 1 ms makes no difference.",
        experiments=("bearing",),
        variants=(AS_PRINTED, CORRECTED, "control at 1 ms"),
        lines=(
            PrintedLine("back/variable", "x back to 10 % after guiding, α 6", "s"),
            PrintedLine("back/traditional", "x back to 10 % after guiding, traditional", "s"),
            PrintedLine("left/variable", "away from the start before the knocks, α 6", "mm"),
            PrintedLine(
                "left/traditional", "away from the start before the knocks, traditional", "mm"
            ),
            PrintedLine("knocked/variable", "moved while knocked, α 6", "mm"),
        ),
        drawn=True,
    ),
}

HUANG2025 = Paper(
    name="huang2025",
    title="Huang et al., Variable Parameter Admittance Control of Robot Based on a Virtual "
    "Force/Torque Sensor, IEEE/ASME Transactions on Mechatronics, 2025",
    doi="10.1109/TMECH.2025.3595612",
    experiments=EXPERIMENTS,
    items=ITEMS,
    setting=(
        "The paper's recordings are not public: every experiment runs on a simulated equivalent, "
        "a scenario of vftcli simulate with the seeds that are stated.",
        "“As printed” computes by the printed formulas (--as-printed), errors of the print "
        "included; “corrected” by the ones that docs/errata.md gives, R and Q_p as densities; “R "
        "discrete” likewise, R and Q_p as covariances of samples; “floor” is the error of the "
        "reference itself.",
        "Beside a mean over the seeds stands its range, least to greatest.",
    ),
)
