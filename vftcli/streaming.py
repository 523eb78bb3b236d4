"""Long logs: the analysis in blocks, so that memory does not grow with the log."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.analysis import Analysis
from vftcli.doctor.examination import stretches
from vftcli.observers.observer import BlockObserver
from vftcli.observers.table import OBSERVERS
from vftcli.pipeline import AnalysisChoice, observe, read, run_of, sense
from vftcli.robots.run import Run
from vftcli.robots.terms import RunningTerms
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.progress import stage
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import caution
from vftcli.signals.series import clock_of
from vftcli.signals.steady_filter import PIECE

#: Longer logs are analysed in blocks, to bound memory. [samples]
WHOLE_ROWS = 100_000


def comes_in_blocks(recording: Recording, choice: AnalysisChoice) -> bool:
    """Whether a log is long and nothing asked needs all of it at once."""
    if recording.samples <= WHOLE_ROWS or recording.dq is None or recording.source.derived:
        return False
    if choice.looks_back or choice.lists_contacts or choice.reference is not None:
        return False
    names, wrench = choice.observers.names, choice.wrench
    if wrench is not None:
        asked = (wrench.torque_sd, wrench.sensor_pose, wrench.zero.start, *wrench.zero.spans)
        if any(map(wrench.smooths, names)) or any(asked):
            return False
    return all(OBSERVERS[name].online for name in names)


def analysed_in_blocks(
    recording: Recording, choice: AnalysisChoice
) -> Iterator[tuple[Analysis, slice | None]]:
    """The analyses of a log's blocks, in order; the log's last, with None for rows.

    The last holds the estimates of the last block alone. The log is examined in stretches;
    its clock, its numbers and impossible samples are checked in all of it.
    """
    robot = choice.examiner.robot(stretches(recording), choice.robot)
    log = choice.examiner.read_as(recording, robot, choice.read, in_stretches=True)
    examined = choice.examiner.examine(log, robot, in_stretches=True)
    whole, part = (read(run_of(x, robot, choice), choice) for x in (log, stretches(log)))
    made = observe(whole, None, choice, running=False)
    sensed = sense(replace(made, motion=part), choice).virtual_sensor
    made = replace(made, examinations=(examined,))
    terms = RunningTerms(robot, clock_of(log.t), literal=choice.observers.as_printed)
    states: dict[str, Any] = {}
    estimates: list[ExternalTorque] = []
    masked, least, done = list[np.ndarray](), np.inf, 0
    for block in log.blocks(PIECE):
        of_block, estimates = terms.next(block), []
        for observer in made.observers:
            assert isinstance(observer, BlockObserver)
            estimate, states[observer.name] = observer.run(of_block, states.get(observer.name))
            estimates.append(estimate)
        if sensed is not None:
            wrenches = sensed.sensor.wrenches(estimates, block.q, robot.chain)
            sensed = replace(sensed, wrenches=wrenches)
            masked.append(wrenches[0].hidden)
            if wrenches[0].sigma_min is not None:
                least = min(least, np.min(wrenches[0].sigma_min))
        done += block.samples
        stage("estimating", done / log.samples)
        motion = replace(whole, log=Run(recording=block, robot=robot))
        own = replace(made, motion=motion, estimates=tuple(estimates), virtual_sensor=sensed)
        yield own, slice(None)
    if sensed is not None:
        from vftcli.wrench.sensing import mask_remark

        hidden = np.concatenate(masked)
        more = (*mask_remark(hidden, np.array([least])), caution("no-wrench-band"))
        sensed = replace(sensed, wrenches=(), masked=hidden, remarks=(*sensed.remarks, *more))
    yield replace(made, estimates=tuple(estimates), virtual_sensor=sensed), None
