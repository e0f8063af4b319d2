"""The command `onedemo`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from . import demonstrations as demo_commands
from .console import console, labeled, missing_library
from .interruption import INTERRUPTED

BAD_INPUT = 2
USAGE: Any = typer.BadParameter.__base__
"""What typer raises for a wrong command line; of typer itself or of click, as the version has it."""
app = typer.Typer(
    help="One demonstration in, a robot policy out, and a benchmark that proves it.\n\nStart with: onedemo run stack",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.add_typer(demo_commands.app, name="demo")


@app.command()
def run(
    config: Annotated[str, typer.Argument(help="A YAML file, or the name of a shipped config, like stack.")],
    overrides: Annotated[list[str] | None, typer.Argument(metavar="KEY=VALUE", help="Changes to the config.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where run folders are made.")] = Path("runs"),
    shard: Annotated[str | None, typer.Option(help="Only part i of n of the episodes, as i/n.")] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run again what was lost with its worker.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the run folder, and errors.")] = False,
) -> None:
    """Run the episodes of a config, a whole comparison or a single cell, and write a report.

    Keys of a cell: name, task, method, demonstration, episodes, level, robot, seed, obstacles, env, max_seconds,
    video, trajectories, settings. Keys with dots reach into settings: settings.motion.guide=0.2

    A comparison has lists of values under sweep, and may have defaults and exclude; a change of a swept key takes the
    place of its values. How it is run: executor (process, serial, ray), workers, address, wall_seconds.

    Finished episodes are kept, whatever happens: running the same config again goes on where it stopped. The last
    line on standard output is the run folder.

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
    config: Annotated[str, typer.Argument(help="A YAML file, or the name of a shipped training, like reach_sac.")],
    overrides: Annotated[list[str] | None, typer.Argument(metavar="KEY=VALUE", help="Changes to the config.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Where folders are made.")] = Path("trainings"),
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the folder, and errors.")] = False,
) -> None:
    """Train a learner on a task from several seeds, and write its curves and its best actor.

    Keys: name, task, algorithm (sac, ppo, sac-her, sac-demo, bc, residual), demonstration, steps, seeds, seed,
    evaluate_every, evaluate_episodes, level, robot, env, learner, executor, workers, address, wall_seconds, device.

    Everything is kept up to the last evaluation, whatever happens: the same command goes on, also with more steps or
    seeds, and ends with the same curve. The last line on standard output is the folder. Needs the extra rl.

    Examples:
    - onedemo train reach_sac

    - onedemo train place_demo steps=400000 learner.batch_size=512
    """
    from .train.command import run_training

    raise typer.Exit(run_training(config, overrides or [], output, quiet=quiet))


@app.command()
def curves(
    trainings: Annotated[list[Path], typer.Argument(metavar="TRAINING", help="Folders of onedemo train, of one task.")],
    run: Annotated[
        Path | None, typer.Option("--run", help="A run folder whose methods need no training: drawn as lines.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder for the files.")] = Path("curves"),
) -> None:
    """Draw trainings of one task in one figure, beside what needs no step: one demonstration, or N steps.

    Reads the folders, whether the trainings are finished or not, and trains nothing. Writes the figure (.png, .pdf),
    every evaluation (.csv) and a page with a table (.md), the last line on standard output.

    Example: onedemo curves trainings/reach-sac-* trainings/reach-ppo-* --run runs/reach-0123456789ab
    """
    from .curves.command import run_curves

    run_curves(trainings, run, output)


@app.command()
def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN", help="Run folders of the same scenarios.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for it; default: the run folder, if there is one.")
    ] = None,
) -> None:
    """Write the report of a run, or compare several: tables, paired tests, figures for a paper, CSV.

    Reads the files of the run folders and runs nothing. report.html needs no server and nothing from elsewhere; its
    figures are also there as PNG and PDF. The last line on standard output is the page.

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
    figure: Annotated[Path | None, typer.Option("--figure", help="Draw it: .png, .pdf or .svg.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the plan as JSON for the judge.")] = None,
    certify: Annotated[bool, typer.Option(help="Let the independent judge look at the plan.")] = True,
    smooth: Annotated[bool, typer.Option("--smooth", help="Lead it along a smooth curve (C1), still clear.")] = False,
    timed: Annotated[bool, typer.Option("--timed", help="As fast as speed and acceleration limits allow.")] = False,
) -> None:
    """Plan one motion round obstacles, without a simulator, and draw it.

    Keys of a scene: title, robot, demonstration, start, goal, obstacles, held, allowed, settings, seed. Shipped
    scenes: free, sphere, wall_gap, shelf, clutter, cage. The exit code is 1 where no plan was found, or it does not
    stay clear when made smooth or timed, which is said with the reason, 2 for a scene that cannot be used, and 3 for
    a plan that the judge refuses.

    Example: onedemo plan wall_gap --figure gap.png
    """
    from .plan.command import run_plan

    raise typer.Exit(run_plan(scene, overrides or [], figure, output, judged=certify, smooth=smooth, timed=timed))


@app.command()
def reproduce(
    names: Annotated[list[str] | None, typer.Argument(metavar="NAME", help="Experiments; without a name all.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="The folder.")] = Path("reproduction"),
    episodes: Annotated[
        int | None, typer.Option("--episodes", min=1, max=1000, help="Seeds of each; 10 if not given.")
    ] = None,
    video: Annotated[bool, typer.Option("--video/--no-video", help="A video of the first seed of each.")] = True,
) -> None:
    """Do the paper's experiments one by one, and write a page with results, figures and times.

    Known: pour, pour_obstacles, stack, shelve, shelve_one, shelve_two, bimanual (an experiment each, some minutes in
    all), tree (escape trees with all their planes, and their times). What is finished is not run again. The last line
    on standard output is the page.

    Examples:
    - onedemo reproduce

    - onedemo reproduce stack tree --no-video
    """
    from .reproduce.command import reproduce

    raise typer.Exit(reproduce(names or [], output, episodes=episodes, video=video))


@app.command()
def geometric(
    scenarios: Annotated[int, typer.Option(min=1, max=1_000_000, help="How many.")] = 1000,
    seed: Annotated[int, typer.Option(min=0, help="That they are drawn from.")] = 0,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("runs/geometric"),
    method: Annotated[list[str] | None, typer.Option(help="Only this one; may be given again.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, max=1024, help="Processes; one for each core.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the folder, and errors.")] = False,
) -> None:
    """Compare the path makers without physics, on thousands of scenarios.

    Three tracks: levels L1 to L3; the demonstration thinned to a few key poses; other tool frames and other worlds.
    Methods: screw, tsia, "tsia, guide 0.5", decoupled, replay, dmp-goal, "dmp-goal, screws", dmp-world, potential,
    and rrt, which takes about a second a path and is run only if it is named.

    What is done is kept: the same command goes on where it stopped. A folder that already has a suite.jsonl uses it.

    Examples:
    - onedemo geometric

    - onedemo geometric --scenarios 200 --seed 7 -o runs/seven --method screw --method rrt
    """
    from .geometric.command import run_geometric

    raise typer.Exit(run_geometric(scenarios, seed, output, methods=method or [], workers=workers, quiet=quiet))


@app.command()
def perf(
    json: Annotated[Path | None, typer.Option("--json", help="Also write the rows to this file.")] = None,
    only: Annotated[str, typer.Option("--only", help="Part of a line's name, or a shell pattern.")] = "*",
) -> None:
    """Measure speeds, as ratios within one run: machines differ and are shared.

    A line is well when its value is at most its goal; the exit code is 1 if one is not. Lines that need
    what is not installed are skipped (extras "peers" and "rl").

    Example: onedemo perf --only controller --json perf.json
    """
    from .perf.command import run_perf

    raise typer.Exit(run_perf(only, json))


@app.command()
def tasks(
    write: Annotated[Path | None, typer.Option("--write", help="Write a page for each task into this folder.")] = None,
    clips: Annotated[bool, typer.Option("--clips", help="With --write: also record a looping clip of each.")] = False,
) -> None:
    """List the environments, or write a documentation page for each.

    A page is the environment's docstring: actions, observations, rewards, starts, ends, options.

    Examples:
    - onedemo tasks

    - onedemo tasks --write docs/tasks --clips
    """
    from .task_pages import list_tasks, write_pages

    if write is None:
        list_tasks()
        return
    for file in write_pages(write, clips=clips):
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


def usage_line(error: Any) -> str:
    """What is wrong with the command line and what is allowed; "" if help was printed instead."""
    text = " ".join(error.format_message().split()).rstrip(".")
    context = getattr(error, "ctx", None)
    if not text or context is None:
        return text
    names = [name for each in context.command.get_params(context) for name in each.opts]
    options = ", ".join(name for name in names if name.startswith("-"))
    commands = getattr(context.command, "commands", None)
    if commands is not None:
        return f"{text}; {context.command_path} knows: {', '.join(commands)}, {options}"
    pieces = " ".join(context.command.collect_usage_pieces(context))
    return f"{text}; usage: {context.command_path} {pieces}; options: {options}"


def main() -> None:
    """Entry point: errors of the project and of the command line become one line, exit code 2."""
    from ..planner.errors import OneDemoError

    try:
        sys.exit(app(prog_name="onedemo", standalone_mode=False) or 0)
    except USAGE as error:
        reason, code = usage_line(error), BAD_INPUT
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
