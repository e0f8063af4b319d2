"""The command `onedemo`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from . import demonstrations as demo_commands
from .console import console, labeled, missing_library
from .interruption import INTERRUPTED
from .mbm.options import mbm
from .robot import command as robot_commands
from .survey.options import survey
from .usage import usage_line

BAD_INPUT = 2
USAGE: Any = typer.BadParameter.__base__
"""Exception of typer for a wrong command line; its class comes from typer or from click, depending on the version."""
app = typer.Typer(
    help="One demonstration in, a robot policy out, and a benchmark that proves it.\n\nStart with: onedemo run stack",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.add_typer(demo_commands.app, name="demo")
robot_commands.app.command()(survey)
app.add_typer(robot_commands.app, name="robot")


@app.command()
def run(
    config: Annotated[
        str, typer.Argument(help="A YAML file, a shipped config like stack, or a task my_tasks:MY_TASK.")
    ],
    overrides: Annotated[list[str] | None, typer.Argument(metavar="KEY=VALUE", help="Changes to the config.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Parent of the run folder.")] = Path("runs"),
    shard: Annotated[str | None, typer.Option(help="Run only part i of n of the episodes, given as i/n.")] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Rerun episodes lost with their worker.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the run folder, and errors.")] = False,
) -> None:
    """Run the episodes of a config, a whole comparison or a single cell, and write a report.

    Keys of a cell: name, task, method, demonstration, episodes, level, robot, seed, obstacles, env, max_seconds,
    video, trajectories, settings. Dotted keys change nested settings: settings.motion.guide=0.2

    A comparison lists the values of a key under sweep, and may have defaults and exclude; setting a swept key on the
    command line replaces its list. Execution: executor (process, serial, ray), workers, address, wall_seconds.

    Finished episodes are always kept: the same command continues where it stopped. The last line on standard output is
    the run folder.

    Examples:
    - onedemo run stack

    - onedemo run configs/bench/stack.yaml episodes=50 level=L2 seed=1000

    - onedemo run headline method=screw workers=8

    - onedemo run headline --shard 2/16
    """
    from .run.command import run_config

    raise typer.Exit(run_config(config, overrides or [], output, shard=shard, retry=retry, quiet=quiet))


@app.command()
def train(
    config: Annotated[
        str, typer.Argument(help="A YAML file, a shipped training like reach_sac, or a task my_tasks:MY_TASK.")
    ],
    overrides: Annotated[list[str] | None, typer.Argument(metavar="KEY=VALUE", help="Changes to the config.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Parent of the folder.")] = Path("trainings"),
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the folder, and errors.")] = False,
) -> None:
    """Train a learner on a task with several seeds, and write its learning curves and its best actor.

    Keys: name, task, algorithm (sac, ppo, sac-her, sac-demo, bc, residual), demonstration, steps, seeds, seed,
    evaluate_every, evaluate_episodes, level, robot, env, learner, executor, workers, address, wall_seconds, device.

    Everything up to the last evaluation is always kept: the same command continues, also with more steps or seeds, and
    yields the same curve. The last line on standard output is the folder. Needs the extra rl.

    Examples:
    - onedemo train reach_sac

    - onedemo train place_demo steps=400000 learner.batch_size=512
    """
    from .train.command import run_training

    raise typer.Exit(run_training(config, overrides or [], output, quiet=quiet))


@app.command()
def curves(
    trainings: Annotated[
        list[Path], typer.Argument(metavar="TRAINING", help="Folders written by onedemo train, of one task.")
    ],
    run: Annotated[Path | None, typer.Option("--run", help="A run folder: its methods are drawn as lines.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the files.")] = Path("curves"),
) -> None:
    """Draw the learning curves of trainings of one task in one figure, beside methods that need no training.

    Reads the folders of finished and unfinished trainings, and trains nothing. Writes the figure (.png, .pdf), every
    evaluation (.csv) and a page with a table (.md), whose path is the last line on standard output.

    Example: onedemo curves trainings/reach-sac-* trainings/reach-ppo-* --run runs/reach-0123456789ab
    """
    from .curves.command import run_curves

    run_curves(trainings, run, output)


@app.command()
def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN", help="Run folders of the same scenarios.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the report; default: the run folder, if only one is given."),
    ] = None,
) -> None:
    """Write the report of a run, or compare several runs: tables, paired tests, figures for a paper, CSV.

    Reads the files of the run folders and runs nothing. report.html is self-contained (no server, no external files);
    its figures are also written as PNG and PDF. The last line on standard output is the page.

    Examples:
    - onedemo report runs/stack-0123456789ab

    - onedemo report runs/mine runs/theirs --output comparison
    """
    from .report.command import run_report

    run_report(runs, output)


@app.command()
def plan(
    scene: Annotated[str, typer.Argument(help="A YAML file, or the name of a shipped scene, like wall_gap.")],
    overrides: Annotated[list[str] | None, typer.Argument(metavar="KEY=VALUE", help="Changes to the scene.")] = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="Draw the plan into this file (.png, .pdf or .svg).")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the plan as JSON, to be judged.")] = None,
    certify: Annotated[bool, typer.Option(help="Check the plan with the independent judge.")] = True,
    smooth: Annotated[bool, typer.Option("--smooth", help="Smooth the path to a clear C1 curve.")] = False,
    timed: Annotated[bool, typer.Option("--timed", help="Time-optimal within speed and acceleration limits.")] = False,
) -> None:
    """Plan one motion around obstacles, without a simulator, and draw it.

    Keys of a scene: title, robot, demonstration, start, goal, obstacles, held, allowed, settings, seed. Shipped
    scenes: free, sphere, wall_gap, shelf, clutter, cage. Exit code 1: no plan was found, or the smoothed or timed plan
    does not stay clear (the reason is printed); 2: the scene cannot be used; 3: the judge refuses the plan.

    Example: onedemo plan wall_gap --figure gap.png
    """
    from .plan.command import run_plan

    raise typer.Exit(run_plan(scene, overrides or [], figure, output, judged=certify, smooth=smooth, timed=timed))


@app.command()
def reproduce(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME", help="Names of experiments; default: all.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of page and runs.")] = Path("reproduction"),
    episodes: Annotated[
        int | None, typer.Option("--episodes", min=1, max=1000, help="Number of seeds per experiment; default: 10.")
    ] = None,
    video: Annotated[bool, typer.Option("--video/--no-video", help="Record each experiment's first seed.")] = True,
) -> None:
    """Reproduce the paper's experiments, and write a page with results, figures and times.

    Known: pour, pour_obstacles, stack, shelve, shelve_one, shelve_two, bimanual (an experiment each, some minutes in
    all), tree (escape trees with all their planes, and their times). Finished experiments are not run again. The last
    line on standard output is the page.

    Examples:
    - onedemo reproduce

    - onedemo reproduce stack tree --no-video
    """
    from .reproduce.command import reproduce

    raise typer.Exit(reproduce(names or [], output, episodes=episodes, video=video))


@app.command()
def geometric(
    scenarios: Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of scenarios.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the scenarios.")] = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("runs/geometric"),
    method: Annotated[list[str] | None, typer.Option(help="Run only this method; repeatable.")] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=1024, help="Number of processes; default: one per core.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the folder, and errors.")] = False,
) -> None:
    """Compare path generators without physics, on thousands of scenarios.

    Three tracks: levels L1 to L3; the demonstration thinned to a few key poses; other tool frames and world frames.
    Methods: screw, tsia, "tsia, guide 0.5", decoupled, replay, dmp-goal, "dmp-goal, screws", dmp-world, potential,
    and rrt, which takes about a second per path and runs only if it is named.

    Finished paths are always kept: the same command continues where it stopped. If the folder holds a suite.jsonl, its
    scenarios are used.

    Examples:
    - onedemo geometric

    - onedemo geometric --scenarios 200 --seed 7 -o runs/seven --method screw --method rrt
    """
    from .geometric.command import run_geometric

    raise typer.Exit(run_geometric(scenarios, seed, output, methods=method or [], workers=workers, quiet=quiet))


@app.command()
def perf(
    json: Annotated[Path | None, typer.Option("--json", help="Also write the rows to this file.")] = None,
    only: Annotated[str, typer.Option("--only", help="Part of a row's name, or a shell pattern.")] = "*",
    long: Annotated[
        bool, typer.Option("--long", help="Also the ticks of 20 episodes of nine cells: 20 minutes.")
    ] = False,
) -> None:
    """Measure speeds, as ratios within one run: machines differ and are shared.

    A row passes if its value does not exceed its limit; the exit code is 1 if a row fails. Rows that need packages
    that are not installed are skipped (extras "peers" and "rl").

    Example: onedemo perf --only controller --json perf.json
    """
    from .perf.command import run_perf

    raise typer.Exit(run_perf(only, json, long=long))


app.command()(mbm)


@app.command()
def tasks(
    own: Annotated[
        list[str] | None, typer.Argument(metavar="TASK", help="Dotted paths of your own tasks: only these.")
    ] = None,
    write: Annotated[Path | None, typer.Option("--write", help="Write a page per task into this folder.")] = None,
    clips: Annotated[bool, typer.Option("--clips", help="With --write: also record a looping clip each.")] = False,
) -> None:
    """List the environments, or write a documentation page for each.

    A page is the environment's docstring: actions, observations, rewards, starts, ends, options. That of a task of your
    own is written from its data; without --write it is printed.

    Examples:
    - onedemo tasks

    - onedemo tasks my_tasks:PEG_IN_HOLE

    - onedemo tasks --write docs/tasks --clips
    """
    from .task_pages import list_tasks, own_page, write_own_pages, write_pages

    if write is None:
        if own:
            console().print("\n\n".join(own_page(path) for path in own), markup=False, highlight=False, soft_wrap=True)
        else:
            list_tasks()
        return
    for file in write_own_pages(own, write) if own else write_pages(write, clips=clips):
        console().print(str(file))


@app.command()
def schema() -> None:
    """Print the JSON schema of configs, for editors.

    Example: onedemo schema > onedemo.schema.json
    """
    import json

    from ..configs.run_config import json_schema

    console().print(json.dumps(json_schema(), indent=2))


@app.command()
def version() -> None:
    """Print the version."""
    from importlib.metadata import version as installed

    console().print(installed("onedemo"))


def main() -> None:
    """Run the command line; errors of the project and of the command line become one line and exit code 2."""
    from ..planner.errors import OneDemoError

    try:
        sys.exit(app(prog_name="onedemo", standalone_mode=False) or 0)
    except USAGE as error:
        reason, code = usage_line(error, sys.argv[1:]), BAD_INPUT
    except typer.Abort:
        reason, code = "stopped", INTERRUPTED
    except OneDemoError as error:
        reason, code = str(error), BAD_INPUT
    except (ImportError, OSError) as error:
        reason, code = missing_library(error), BAD_INPUT
        if not reason:
            raise
    if reason:
        console(stderr=True).print(labeled("error", "red", reason))
    sys.exit(code)
