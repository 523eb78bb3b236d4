"""The declared paper is whole: every table and figure, every experiment, every printed number."""

import inspect

import pytest

from vftcli.evaluation.published import TABLE_1
from vftcli.reproduction.experiments import RUNS
from vftcli.reproduction.paper import PAPERS, PrintedLine, paper_of
from vftcli.signals.errors import ParameterError

HUANG = PAPERS["huang2025"]
EXPERIMENTS, ITEMS = HUANG.experiments, HUANG.items


def test_no_table_and_no_figure_is_missing() -> None:
    """Four tables and thirteen figures in print."""
    wanted = {f"table{k}" for k in range(1, 5)} | {f"fig{k}" for k in range(1, 14)}
    assert set(ITEMS) == wanted
    pictures = {name for name, item in ITEMS.items() if item.verdict == "a picture"}
    assert pictures == {"fig1", "fig2", "fig5", "fig8", "fig11"}
    for name, item in ITEMS.items():
        assert item.why.endswith("."), name
        assert bool(item.experiments) == bool(item.lines) == (name not in pictures), name


def test_every_experiment_is_shown_and_gives_its_function_what_that_asks_for() -> None:
    assert {name for item in ITEMS.values() for name in item.experiments} == set(EXPERIMENTS)
    for experiment in EXPERIMENTS.values():
        inspect.signature(RUNS[experiment.run]).bind(experiment.seeds[0], **experiment.given)
    assert {experiment.run for experiment in EXPERIMENTS.values()} == set(RUNS)


def test_the_printed_numbers_are_the_papers() -> None:
    """Tables I and II; Figs. 6 and 9 from detection on; Fig. 7's one advance of .64 s."""
    printed = {
        name: {line.key: line.printed for line in item.lines} for name, item in ITEMS.items()
    }
    assert len(printed["table1"]) == 24
    assert printed["table1"]["kfo-zoh/6"] == f"{TABLE_1.rmse['kfo-zoh'][5]:.4f}" == "0.9440"
    # 58.3627 s over 10.8690 s and over 17.5776 s.
    ratios = [printed["table2"][key] for key in ("zoh/fdo", "zoh/kfo-fe")]
    assert ratios == ["5.37", "3.32"]
    times = [line for line in ITEMS["table2"].lines if line.key.startswith("seconds/")]
    assert {line.label.partition(":")[0]: line.number for line in times} == {
        "FDO": 10.869, "GMO": 10.541, "KFO-FE": 17.578, "KFO-ZOH": 58.363
    }  # fmt: skip
    assert not any(line.compared for line in times)
    # 6.52 → 6.76 s, 17.72 → 18.00, 8.60 → 8.86, 20.16 → 20.28 s of Fig. 6.
    timed = {"fig6": ("0.24", "0.28", "0.26", "0.12"), "fig9": ("0.16", "0.16", "0.16", "0.12")}
    for name, numbers in timed.items():
        keys = ("reaction/1", "reaction/2", "stop/1", "stop/2")
        shown = {key: text for key, text in printed[name].items() if text}
        assert shown == dict(zip(keys, numbers, strict=True))
    turns = [line for line in ITEMS["fig7"].lines if line.key.startswith("turn/1.9/")]
    said = [(line.label.split(", ")[-1], line.printed) for line in turns]
    assert said == [("phase I", "0.64"), ("phase II", "0.64")]


def test_keys_stand_once_in_an_item() -> None:
    for name, item in ITEMS.items():
        keys = [line.key for line in item.lines]
        assert len(keys) == len(set(keys)), name
        assert item.nearest in item.variants, name


def test_a_bound_is_no_number() -> None:
    assert PrintedLine("k", "label", "N", "9.66").number == 9.66
    assert PrintedLine("k", "label", "N", "< 6").number is None
    assert PrintedLine("k", "label").number is None


def test_items_come_in_the_papers_order_and_what_is_not_there_is_reported() -> None:
    assert HUANG.chosen("fig7, table1") == ("table1", "fig7")
    assert HUANG.chosen(None) == tuple(HUANG.items)
    for words in ("fig14", "table1,nothing", ","):
        with pytest.raises(ParameterError, match="there is table1, table2, fig1"):
            HUANG.chosen(words)
    with pytest.raises(ParameterError, match="no paper 'huang2026'; there is huang2025"):
        paper_of("huang2026")
