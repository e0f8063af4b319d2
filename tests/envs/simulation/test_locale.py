"""Models are the same in every locale: a decimal comma is common, and a program with windows sets it."""

from __future__ import annotations

import ast
import locale
import shutil
import subprocess

import numpy as np
import pytest
from helpers.import_graph import ROOT, SOURCES, tree_of

from onedemo.envs import ROBOTS
from onedemo.envs.mujoco_library import compiled_model, mujoco
from onedemo.envs.scene import scene

OBJ = "v 0.25 0.5 0\nv 1.5 0 0\nv 0 1.25 0\nv 0 0 1.75\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"
TEXT = '<mujoco><asset><mesh name="m" file="{}"/></asset><worldbody><geom type="mesh" mesh="m" pos=".1 .2 .3"/>'
TEXT += "</worldbody></mujoco>"


@pytest.fixture(scope="module")
def comma(tmp_path_factory):
    """Locale with a decimal comma, made here: few machines have one."""
    folder = tmp_path_factory.mktemp("locales")
    if shutil.which("localedef") is None:
        pytest.skip("no localedef")
    made = ["localedef", "-c", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
    subprocess.run(made, capture_output=True)
    if not (folder / "de_DE.UTF-8").is_dir():
        pytest.skip("no definition of a locale with a decimal comma: apt install locales")
    return folder


@pytest.fixture
def german(comma, monkeypatch):
    """Function that sets the locale of this process, and lets MuJoCo forget the files that it has read."""
    before = locale.setlocale(locale.LC_ALL)
    monkeypatch.setenv("LOCPATH", str(comma))

    def chosen():
        mujoco.mj_clearCache(mujoco.mj_getCache())
        return locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")

    yield chosen
    locale.setlocale(locale.LC_ALL, before)
    mujoco.mj_clearCache(mujoco.mj_getCache())


def arrays(model):
    names = (
        "mesh_vert",
        "mesh_pos",
        "geom_pos",
        "geom_size",
        "body_mass",
        "body_inertia",
        "jnt_range",
        "actuator_gainprm",
    )
    return {name: np.array(getattr(model, name)) for name in names}


def assert_equal(one, other):
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def test_model_files_and_texts_are_read_alike(german, tmp_path):
    (tmp_path / "m.obj").write_text(OBJ)
    (tmp_path / "m.xml").write_text(TEXT.format("m.obj"))
    sources = (tmp_path / "m.xml", TEXT.format(tmp_path / "m.obj"))
    before = [arrays(compiled_model(source)) for source in sources]
    assert german() and locale.localeconv()["decimal_point"] == ","
    model = mujoco.MjModel.from_xml_path(str(sources[0]))
    assert not np.allclose(model.mesh_vert, before[0]["mesh_vert"]), "MuJoCo alone reads this wrongly, and keeps it"
    for source, mine in zip(sources, before, strict=True):
        assert_equal(arrays(compiled_model(source)), mine)
        assert locale.setlocale(locale.LC_NUMERIC) == "de_DE.UTF-8", "the user's locale is as it was"
    with pytest.raises(ValueError):
        compiled_model("<mujoco><nonsense/></mujoco>")
    assert locale.setlocale(locale.LC_NUMERIC) == "de_DE.UTF-8"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "Panda" else pytest.mark.slow) for name in ROBOTS]
)
def test_scenes_are_compiled_alike(german, name):
    before = scene.compiled_scene(ROBOTS[name])
    german()
    sides = tuple(index.side for index in before.arms)
    after = scene._compiled.__wrapped__(ROBOTS[name], before.spec, sides)
    assert_equal(arrays(before.model), arrays(after.model))
    np.testing.assert_array_equal(before.arms[0].arm.chain, after.arms[0].arm.chain)


def test_no_other_module_gives_mujoco_a_model():
    """Nor reads or writes numbers as the locale has them."""
    for path in SOURCES:
        own = str(path.relative_to(ROOT)) == "envs/mujoco_library.py"
        names = {node.attr for node in ast.walk(tree_of(path)) if isinstance(node, ast.Attribute)}
        found = names & {"from_xml_path", "from_xml_string", "from_file", "from_string", "atof", "format_string"}
        assert own or not found, f"{path}: {found}"
