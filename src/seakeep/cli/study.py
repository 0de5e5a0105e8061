"""``seakeep study``, ``reproduce`` and ``report``."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from seakeep.cli.console import Scheduler, cores, executor_of, print_table, progress_bar, show

if TYPE_CHECKING:
    from seakeep.study import StudyResult

Preset = Literal["paper", "recommended"]

Workers = Annotated[
    int | None,
    Option(
        help="Processes on this machine, each on one core; by default one per core.",
        min=1,
        metavar="N",
    ),
]


def study(
    study_file: Annotated[Path, Argument(help="Study file.", metavar="STUDY.toml")],
    out: Annotated[
        Path | None, Option("-o", "--out", help="Folder; by default named after the study file.")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Run a study and write its report.

    Each model is fitted on each training set and judged in each test window. After an
    interruption, the same command continues the study.

    Example: seakeep study examples/ntnu_ship_section/study.toml -o ship-study
    """
    from seakeep.report.sections.results import findings, overview_table
    from seakeep.study import read_study, run_study

    asked = read_study(study_file)
    folder = out or study_file.parent / f"{study_file.stem}-results"
    with executor_of(workers, scheduler, cores()) as executor:
        with progress_bar("Study") as tell:
            result = run_study(asked, folder, executor=executor, progress=tell)
        page = _write_study(result)
    print_table(overview_table(result), note=False)
    for text in findings(result):
        show(text)
    show(f"\nReport: {page}")


def _write_study(result: StudyResult) -> Path:
    from seakeep.report.sections import write_report

    with progress_bar("Report") as tell:
        return write_report(result, tell)


def reproduce(
    out: Annotated[Path, Option("--out", "-o", help="Output folder.")] = Path("reproduction"),
    quick: Annotated[
        bool, Option("--quick", help="All stages with small counts, in half of the time.")
    ] = False,
    preset: Annotated[Preset | None, Option(help="The acts of this preset alone.")] = None,
    seed: Annotated[
        int, Option(help="Seed of waves, noise, windows, draws.", min=0, max=2**64 - 1)
    ] = 0,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Reproduce the paper's study on the virtual tank, in three acts.

    Simulates six runs, and runs three studies of them: the paper's procedure, the same on channels
    with their slow drift, and the recommended model. Writes statistics, figures, tables and a
    report.

    Example: seakeep reproduce --quick --out quick
    """
    from seakeep.report.acts import finding, short_table
    from seakeep.study.reproduce import ACTS, Size
    from seakeep.study.reproduce import reproduce as reproduce_study

    with executor_of(workers, scheduler, cores()) as executor:
        with progress_bar("Study") as tell:
            results = reproduce_study(
                out,
                preset,
                size=Size.quick() if quick else Size(),
                seed=seed,
                executor=executor,
                progress=tell,
            )
        page = _write_reproduction(out, results, executor)
    print_table(short_table(results))
    show(finding(results))
    for act in ACTS:
        if act.name in results:
            show(f"{act.title}: {act.sentence}")
    show(f"\nReport: {page}")


def report(
    folder: Annotated[Path, Argument(help="Folder of a study's results.", metavar="DIR")],
) -> None:
    """Write the report of a finished study.

    One HTML file, figures, and tables.

    Example: seakeep report reproduction
    """
    from seakeep.study import read_result
    from seakeep.study.reproduce import read_reproduction

    if acts := read_reproduction(folder):
        page = _write_reproduction(folder, acts)
    else:
        page = _write_study(read_result(folder))
    typer.echo(str(page))


def _write_reproduction(
    folder: Path, results: dict[str, StudyResult], executor: Executor | None = None
) -> Path:
    """Write the pages of the acts, side by side where workers are near, and the one over all."""
    from seakeep.executor import in_order, on_this_machine
    from seakeep.report.acts import write_reproduction
    from seakeep.report.sections import write_report

    near = on_this_machine(executor)
    for each in () if near else results.values():
        with progress_bar(f"Report of {each.attrs['study']}") as tell:
            write_report(each, tell)
    with progress_bar("Report") as tell:
        if near:
            pages = in_order(_write_act, None, [*results.values()], near)
            for done, name in enumerate(results):
                tell(done, len(results), f"page of {name}")
                next(pages)
        return write_reproduction(folder, results, tell)


def _write_act(_: None, result: StudyResult) -> None:
    from seakeep.report.sections import write_report

    write_report(result)
