"""What docs/cluster.md gives for other systems: the job of Kubernetes is valid, and the line for GNU
parallel builds a database."""

import os
import re
import subprocess
from pathlib import Path

import kubernetes_validate
import pytest
import yaml

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/cluster.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def test_the_job_of_kubernetes_is_valid():
    (text,) = blocks("yaml")
    job = yaml.safe_load(text)
    version = kubernetes_validate.latest_version()
    kubernetes_validate.validate(job, version, strict=True)
    assert job["spec"]["completionMode"] == "Indexed"
    # every shard has a task
    command = job["spec"]["template"]["spec"]["containers"][0]["command"]
    assert f"env/{job['spec']['completions']}" in command
    del job["spec"]["template"]
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(job, version, strict=True)


def test_gnu_parallel_builds_all_shards(tmp_path):
    grid = (ROOT / "tests/data/jobs.toml").read_text()
    (tmp_path / "grid.toml").write_text(grid.replace("rays = 20000", "rays = 200"))
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    (parallel,) = [line for line in lines if "parallel" in line]
    (finish,) = [line for line in lines if "--finish" in line]
    path = f"{ROOT / 'target/release'}:{os.environ['PATH']}"
    for line in (parallel, finish):
        environment = os.environ | {"PATH": path, "PARALLEL_HOME": str(tmp_path)}
        subprocess.run(["bash", "-c", line], cwd=tmp_path, env=environment, check=True)
    assert (tmp_path / "out/grid/snow.safetensors").exists()
