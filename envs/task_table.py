"""Facts about any task: a shipped one by its name, a user's own by its dotted path."""

from __future__ import annotations

from .dotted_names import is_dotted
from .facts.task_facts import TaskFacts
from .shipped import TASKS
from .tasks.facts import OWN, own_facts


def facts_of(task: str, *, load: bool = False) -> TaskFacts:
    """Return the facts about a task.

    Args:
        task: name of a shipped task, or dotted path of a user's own.
        load: import the module of a user's own task, which runs its code and registers it; otherwise nothing is
            imported, and its facts are those of all users' own tasks: name, id and time limit are not known.

    Raises:
        BadDottedName: no such module or name, or it is no task.
        BadTask: the task cannot be used.
    """
    if not is_dotted(task):
        return TASKS[task]
    if not load:
        return OWN
    from .tasks.registered import task_at

    return own_facts(task_at(task))
