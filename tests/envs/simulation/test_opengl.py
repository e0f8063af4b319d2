"""Where pictures can be drawn, and one line where they cannot; what draws nothing loads nothing that draws."""

from __future__ import annotations

import gc
import os
import pickle
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from threading import Thread

import gymnasium as gym
import numpy as np
import pytest

from onedemo.envs.errors import BadAction, NoRoom, RenderingUnavailable
from onedemo.planner.errors import BadOption, BadShape, UnknownName

HERE = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY")}
DRAWING = ["OpenGL", "glfw", "matplotlib", "PIL", "imageio", "cv2", "mujoco.viewer"]
STARTED = """
import sys
import gymnasium as gym, onedemo.envs
env = gym.make("onedemo/Reach-v0", render_mode="rgb_array")
env.reset(seed=0)
env.step(env.action_space.sample())
"""


def said(code, **variables):
    """What a program prints; it must end by itself and well, within a time that only a hang exceeds."""
    run = [sys.executable, "-W", "error::ResourceWarning", "-c", code]
    done = subprocess.run(run, capture_output=True, text=True, env={**HERE, **variables}, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr, done.stderr[-2000:]
    return done.stdout.splitlines()


@pytest.fixture
def drawn():
    """Environment that has drawn a picture, and the picture."""
    env = gym.make("onedemo/Reach-v0", render_mode="rgb_array")
    env.reset(seed=0)
    try:
        picture = env.render()
    except RenderingUnavailable as error:
        pytest.skip(str(error))
    yield env, picture
    env.close()


def test_any_thread_draws_the_same_picture_also_many_at_once(drawn):
    env, picture = drawn
    for _ in range(2):  # each of another thread than the one before
        with ThreadPoolExecutor(1) as pool:
            np.testing.assert_array_equal(pool.submit(env.render).result(), picture)
    other = gym.make("onedemo/Reach-v0", render_mode="rgb_array")
    other.reset(seed=0)
    with ThreadPoolExecutor(4) as pool:
        for found in [pool.submit(each.render) for each in (env, other) * 3]:
            np.testing.assert_array_equal(found.result(), picture)
    closing = Thread(target=other.close)
    closing.start()
    closing.join()
    np.testing.assert_array_equal(env.render(), picture)
    np.testing.assert_array_equal(other.render(), picture)
    other.close()


def test_garbage_that_is_collected_in_the_middle_of_a_picture_does_not_spoil_it(drawn, monkeypatch):
    env, picture = drawn
    lost = gym.make("onedemo/Reach-v0", render_mode="rgb_array")
    lost.reset(seed=0)
    lost.render()
    lost.unwrapped.circle = lost
    del lost
    from onedemo.envs.simulation import render

    def collected(*args):
        gc.collect()
        return update(*args)

    update = render.mujoco.mjv_updateScene
    monkeypatch.setattr(render.mujoco, "mjv_updateScene", collected)
    np.testing.assert_array_equal(env.render(), picture)


FORKED = (
    STARTED
    + """
import gc, multiprocessing, os
try:
    env.render()
except Exception as error:
    print("no picture at all"); raise SystemExit
def draw():
    try:
        env.render(); print("drew", flush=True)
    except Exception as error:
        print(type(error).__name__, error, flush=True)
    env.step(env.action_space.sample())
    env.close(); gc.collect()
if CLOSED: env.close()
child = multiprocessing.get_context("fork").Process(target=draw)
child.start(); child.join(); print(child.exitcode, flush=True)
pid = os.fork()
if pid == 0:
    draw(); raise SystemExit
print(os.waitpid(pid, 0)[1], flush=True)
print(env.render().std() > 10)
env.close()
"""
)


@pytest.mark.parametrize("closed", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["open", "closed before"])
def test_a_fork_of_a_process_that_has_drawn_refuses_to_draw_and_ends_well(closed):
    lines = said(FORKED.replace("CLOSED", str(closed)))
    if lines == ["no picture at all"]:
        pytest.skip("no OpenGL")
    refusal = [line for line in lines if line.startswith("RenderingUnavailable")]
    assert len(refusal) == 2 and all("before this process was forked" in line for line in refusal)
    assert all("spawn" in line for line in refusal)
    assert [line for line in lines if line not in refusal] == ["0", "0", "True"]


@pytest.mark.filterwarnings("ignore:.*(Received the following error|Raising the last|Traceback)")
def test_workers_of_a_vector_environment_that_may_not_draw_say_so_in_one_line(drawn):
    make = {"vectorization_mode": "async", "render_mode": "rgb_array", "vector_kwargs": {"context": "fork"}}
    envs = gym.make_vec("onedemo/Reach-v0", num_envs=2, **make)
    try:
        envs.reset(seed=0)
        envs.step(envs.action_space.sample())
        with pytest.raises(RenderingUnavailable) as caught:
            envs.render()
    finally:
        envs.close(terminate=True)
    text = str(caught.value)
    assert text.count("no picture can be drawn") == 1 and "\n" not in text and "spawn" in text


@pytest.mark.parametrize(
    "error",
    [
        RenderingUnavailable("no EGL"),
        BadAction("entry 3 is not finite"),
        NoRoom("static"),
        UnknownName("level", "L9", ("L0", "L1")),
        BadOption("level", "is odd"),
        BadShape("q", (3,), "(7,)"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_of_another_process_is_the_same_error(error):
    kind, sent = pickle.loads(pickle.dumps((type(error), error)))
    assert (str(sent), type(sent), vars(sent)) == (str(error), type(error), vars(error))
    assert str(kind(sent)) == str(error), "as Gymnasium's vector environments raise it"


@pytest.mark.parametrize(
    "wanted, words",
    [
        ("osmesa", r"osmesa: "),
        ("nonsense", r"MUJOCO_GL=nonsense is unknown\); allowed are egl, osmesa, glfw"),
        *(
            pytest.param(wanted, words, marks=pytest.mark.slow)
            for wanted, words in [
                ("glfw", r"glfw: "),
                ("GLX", r"MUJOCO_GL=glx is unknown\); allowed are egl, osmesa, glfw"),
                ("disable", r"MUJOCO_GL=disable turns pictures off"),
                ("egl", r"egl: "),
            ]
        ),
    ],
)
def test_a_backend_that_cannot_draw_is_one_line_and_only_of_a_picture(wanted, words):
    code = STARTED + "print(sys.modules.keys().isdisjoint({'OpenGL', 'glfw'}))\n"
    code += (
        "try:\n    env.render(); print('drew')\nexcept Exception as error:\n    print(type(error).__name__, error)\n"
    )
    # no such device: EGL fails even where it is installed
    stepped, *rest = said(code, MUJOCO_GL=wanted, MUJOCO_EGL_DEVICE_ID="99")
    assert stepped == "True" and len(rest) == 1
    if rest != ["drew"]:  # where OSMesa is installed
        assert rest[0].startswith("RenderingUnavailable no picture can be drawn (")
        assert re.search(words, rest[0]), rest[0]
    assert rest != ["drew"] or wanted == "osmesa"


def test_nothing_that_draws_is_imported_before_a_picture_and_the_user_s_choice_stays():
    code = "import os, sys, gymnasium as gym, onedemo.envs, onedemo.planner\n"
    code += "for name in onedemo.planner.__all__: getattr(onedemo.planner, name)\n"
    code += "for name in onedemo.envs.__all__: getattr(onedemo.envs, name)\n"
    code += "from onedemo.baselines import Policy\n"
    code += "gym.make('onedemo/Stack-v0').reset(seed=0)\n"
    code += f"print(sorted(set({DRAWING}) & set(sys.modules)))\n"
    code += "print(os.environ.get('MUJOCO_GL'), os.environ.get('PYOPENGL_PLATFORM'))\n"
    assert said(code) == ["[]", "None None"]


def test_mujoco_s_own_renderer_works_beside():
    code = STARTED + "import mujoco\n"
    code += "model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>')\n"
    code += "data = mujoco.MjData(model)\nmujoco.mj_forward(model, data)\n"
    code += "try:\n    before = env.render()\nexcept Exception:\n    print('no picture'); raise SystemExit\n"
    code += "with mujoco.Renderer(model) as renderer:\n"
    code += "    for _ in range(2):\n"
    code += "        renderer.update_scene(data)\n        print(renderer.render().std() > 1)\n"
    code += "        print((env.render() == before).all())\n"
    assert said(code, MUJOCO_GL="egl") in (["True"] * 4, ["no picture"])
