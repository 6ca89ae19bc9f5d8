"""Campaigns give the same bits here, on threads, and on Ray's workers."""

import os
import json

import pytest
from trocar import campaign

OPTIONS = {"episodes": 2, "seed": 5}
POLICIES = ["scripted", "random"]


@pytest.fixture(scope="module")
def local(short_scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    return folder, campaign.run(str(short_scene), POLICIES, folder / "local", workers=2, **OPTIONS)


def test_threads_keep_every_episode_and_go_on(short_scene, local):
    folder, result = local
    assert result["episodes"] == result["planned"] == 4 and [p["episodes"] for p in result["policies"]] == [2, 2]
    assert (folder / "local/report.html").exists() and (folder / "local/table.csv").exists()
    # With everything there, nothing is run; with one episode gone, one is, to the same bits.
    gone = folder / "local/episodes/random/000001"
    for file in gone.iterdir():
        file.unlink()
    gone.rmdir()
    done = []
    again = campaign.run(
        str(short_scene), POLICIES, folder / "local", workers=1, progress=lambda *n: done.append(n), **OPTIONS
    )
    assert done == [(1, 1)] and again["hash"] == result["hash"]
    with pytest.raises(ValueError, match="another seed"):
        campaign.run(str(short_scene), POLICIES, folder / "local", episodes=2, seed=6)


def test_ray_gives_the_same_bits(short_scene, local):
    ray = pytest.importorskip("ray", reason="Ray is not installed")
    folder, result = local
    lost = []

    def lose(done, missing):
        """Kills a worker's process after the first episode: what it was doing is done again."""
        if not lost:
            from ray.util.state import list_actors

            lost.append(next(a for a in list_actors() if a.state == "ALIVE").pid)
            os.kill(lost[0], 9)

    options = {"workers": 2, "ray_address": "local", **OPTIONS}
    try:
        far = campaign.run(str(short_scene), POLICIES, folder / "far", progress=lose, **options)
    except ImportError as why:
        pytest.skip(f"Ray cannot list its workers: {why}")
    assert far["hash"] == result["hash"] and far["episodes"] == 4
    for kept in sorted((folder / "local/episodes").rglob("episode.trocar")):
        other = folder / "far" / kept.relative_to(folder / "local")
        assert kept.read_bytes() == other.read_bytes()
        assert json.loads(kept.with_name("result.json").read_text()) == json.loads(other.with_name("result.json").read_text())
