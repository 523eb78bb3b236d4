"""Accuracy on real logs whose external torque is known: python tests/accuracy/run.py planted …

For every log the RMSE, mean of the joints [N·m], of the smoother with gains tuned

- without: on the spectra as they are measured,
- whole: the same on terms corrected by the whole log,

the joints that were corrected, and, with --best, the RMSE of the pipeline's observer `best`, the
share of samples its 95 % band holds, joints moving and at rest apart, and the band's half width
over the RMSE. `steady` prints slopes and ratios of the smoother with the robot's own gains. The
logs are those of VFT_LOGS; `vftcli benchmark sim` and `field` score others. Nothing is timed.
"""

import argparse
import os
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2])]

import scenarios  # noqa: E402

from vftcli.bias.whole_log import whole_log_bias  # noqa: E402
from vftcli.free_motion.free_motion import FreeMotion  # noqa: E402
from vftcli.observers import ObserverChoice, spectra  # noqa: E402
from vftcli.observers.table import Setup, build_observers  # noqa: E402
from vftcli.observers.tuning import tune_to_spectra  # noqa: E402
from vftcli.robots.run import Run, RunSamples  # noqa: E402
from vftcli.signals.rest import standing  # noqa: E402

GROUPS = ("planted", "pieces", "steady")


def main() -> None:
    """Print a line a log, and the mean of every group."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("groups", nargs="*", default=GROUPS, help=f"of {', '.join(GROUPS)}")
    parser.add_argument(
        "--robot", help="robot file for the real UR10e logs instead of the profile"
    )
    parser.add_argument("--best", action="store_true", help="the pipeline's observer `best` too")
    parser.add_argument("--length", type=float, default=10.0, help="of the pieces [s]")
    chosen = parser.parse_args()
    lines = defaultdict(list)
    for group in chosen.groups:
        for case in cases_of(group, chosen):
            line = steady_line(case) if group == "steady" else tuned_line(case, chosen)
            lines[group].append(line)
            show(f"{group} {case.name}", line)
    for group, found in lines.items():
        columns = [key for key in found[0] if isinstance(found[0][key], float)]
        show(f"{group} mean", {key: float(np.mean([x[key] for x in found])) for key in columns})
        for key in columns:
            if key.endswith("/without"):
                show(f"{group} worst {key}", {key: max(x[key] for x in found)})


def show(name: str, line: dict[str, object]) -> None:
    """One line of the table."""
    words = (f"{k} {v:.3f}" if isinstance(v, float) else f"{k} {v}" for k, v in line.items())
    print(f"{name:34}", "  ".join(words), flush=True)


def cases_of(group: str, chosen):
    """The logs of a group."""
    logs = Path(os.environ.get("VFT_LOGS", ""))
    if group == "pieces":
        return scenarios.piece_cases(logs, chosen.robot, chosen.length)
    make = scenarios.planted_cases if group == "planted" else scenarios.steady_cases
    return make(logs, chosen.robot)


def rmse(estimate, truth) -> np.ndarray:
    """Root mean square error of each joint over every sample. (n,) [N·m]"""
    return np.sqrt(np.mean((estimate - truth) ** 2, axis=0))


def tuned(run, free):
    """The estimate of the smoother tuned on the spectra of the free part and the rest. (T, n)"""
    found = spectra.spectra_of(RunSamples(run, ~free), [RunSamples(run, free)])
    return tune_to_spectra("rts-auto", found).estimate(run.terms).tau


def tuned_line(case, chosen) -> dict[str, object]:
    """What the tuned smoothers reach on one log."""
    run = Run(recording=case.recording, robot=case.robot)
    free = FreeMotion(log=run, choice=case.free).part.own
    without = rmse(tuned(run, free), case.truth)
    bias = whole_log_bias(run)
    whole = rmse(tuned(bias.corrected(run), free), case.truth)
    line = {"without": float(without.mean()), "whole": float(whole.mean())}
    line["whole/without"] = line["whole"] / line["without"]
    line["applied"] = "".join(str(int(x)) for x in bias.applied)
    line["free"] = round(float(bias.free.mean()), 2)
    return line | (best_line(case) if chosen.best else {})


def best_line(case) -> dict[str, object]:
    """The pipeline's own best estimate, and how its band holds."""
    from vftcli.pipeline import AnalysisChoice, analyse, run_of

    choice = AnalysisChoice(observers=ObserverChoice(names=("best",)), free=case.free)
    estimate = analyse(run_of(case.recording, case.robot, choice), choice).estimates[0]
    error = estimate.tau - case.truth
    line = {"best": float(rmse(estimate.tau, case.truth).mean())}
    if estimate.error_sd is None:
        return line
    rests = standing(case.recording.t, case.recording.dq)
    inside = np.abs(error) <= 1.96 * estimate.error_sd
    line["half width/rmse"] = float(1.96 * estimate.error_sd.mean() / line["best"])
    everywhere = np.ones_like(rests)
    for name, where in (("moving", ~rests), ("rest", rests), ("all", everywhere)):
        shares = [inside[w, j].mean() if w.any() else np.nan for j, w in enumerate(where.T)]
        line[f"held {name}"] = np.round(shares, 2).tolist()
    return line


def steady_line(case) -> dict[str, object]:
    """Slope of the estimate on the truth and RMSE, with the correction and without it."""
    run = Run(recording=case.recording, robot=case.robot)
    bias = whole_log_bias(run)
    setup = Setup(gains=case.robot.gains, settings={}, joints=case.robot.joints,
                  step=case.recording.median_step, as_printed=False)  # fmt: skip
    (observer,), _ = build_observers(("kfo-rts",), setup)
    taus = [observer.estimate(terms).tau for terms in (run.terms, bias.corrected(run).terms)]
    slopes = [float(np.sum(tau * case.truth) / np.sum(case.truth**2)) for tau in taus]
    errors = [float(rmse(tau, case.truth).mean()) for tau in taus]
    line = {"slope without": slopes[0], "slope": slopes[1], "change": abs(slopes[1] - slopes[0])}
    line |= {"without": errors[0], "with": errors[1], "with/without": errors[1] / errors[0]}
    return line | {"applied": "".join(str(int(x)) for x in bias.applied)}


if __name__ == "__main__":
    main()
