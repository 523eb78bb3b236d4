"""Long logs: the same analysis block by block, so that its memory does not grow with the log."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.smoother import block_run, runs_in_blocks
from vftcli.pipeline import AnalysisChoice
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run
from vftcli.robots.terms import RunningTerms
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.steady_filter import PIECE


def comes_in_blocks(recording: Recording, robot: Robot, choice: AnalysisChoice) -> bool:
    """Whether nothing that is asked of a long log needs all of it at once."""
    wrench = choice.wrench
    if recording.long is None or choice.looks_back or choice.lists_contacts:
        return False
    if choice.reference is not None or recording.source.derived or recording.dq is None:
        return False
    names = choice.observers.names
    if wrench is not None:
        asked = (wrench.torque_sd, wrench.sensor_pose, *wrench.zero.spans)
        smooths = any(map(wrench.smooths, names))
        if smooths or wrench.zero.start or any(asked):
            return False
    timing = recording.long.timing
    observers, _ = choice.observers.build(robot, timing.step)
    return all(runs_in_blocks(each, timing.clock, robot.joints) for each in observers)


class BlockAnalysis:
    """The blocks of a long log's analysis, and what is known when the last has gone by."""

    def __init__(self, made: Analysis, choice: AnalysisChoice) -> None:
        self.made, self.choice = made, choice

    def blocks(self) -> Iterator[Analysis]:
        """The analyses of the blocks, in order; `made` is that of the log after the last."""
        long, robot = self.made.recording.long, self.made.robot
        assert long is not None
        clock, samples = long.timing.clock, long.timing.samples
        literal = self.choice.observers.as_printed
        terms = RunningTerms(robot, clock, literal=literal)
        runs = [block_run(observer, clock, robot.joints) for observer in self.made.observers]
        waiting: deque[Recording] = deque()
        ready: list[deque[ExternalTorque]] = [deque() for _ in runs]
        masked, least, done = [], np.inf, 0
        for block in chain(long.blocks(PIECE), (None,)):  # None behind the last
            if block is not None:
                waiting.append(block)
                block_terms = terms.next(block)
            for run, queue in zip(runs, ready, strict=True):
                queue.extend(run.end() if block is None else run.take(block_terms))
            while waiting and all(ready):
                analysis = self._block(waiting.popleft(), [queue.popleft() for queue in ready])
                done += analysis.recording.samples
                self.choice.progress("estimating", done / samples, 1.0)
                for wrench in analysis.wrenches[:1]:
                    masked.append(wrench.hidden)
                    if wrench.sigma_min is not None:
                        least = min(least, float(np.min(wrench.sigma_min)))
                yield analysis
        self._finish(analysis.estimates, masked, least)

    def _block(self, recording: Recording, estimates: Sequence[ExternalTorque]) -> Analysis:
        """The analysis of one block."""
        made, sensed = self.made, self.made.virtual_sensor
        log = Run(recording=recording, robot=made.robot)
        if sensed is not None:
            chain = made.robot.chain
            wrenches = sensed.sensor.wrenches(estimates, recording.q, chain)
            sensed = replace(sensed, wrenches=wrenches)
        return replace(
            made,
            motion=replace(made.motion, log=log),
            estimates=tuple(estimates),
            virtual_sensor=sensed,
        )

    def _finish(
        self, last: Sequence[ExternalTorque], masked: Sequence[np.ndarray], least: float
    ) -> None:
        """Take up what the last block's estimates say of the log, and what the poses hid."""
        sensed = self.made.virtual_sensor
        if sensed is not None:
            from vftcli.virtual_sensor.sensing import mask_remark
            from vftcli.virtual_sensor.torque_error import unknown_error

            hidden = np.concatenate(masked)
            poses = mask_remark(hidden, np.array([least]))
            told = (*sensed.remarks, *poses, *unknown_error().remarks)
            sensed = replace(sensed, masked=hidden, remarks=told)
        self.made = replace(self.made, estimates=tuple(last), virtual_sensor=sensed)
