//! `status` says what the processes of a build do, whatever happened to them.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

use crate::common::Folder;

const GRID: &str = include_str!("data/jobs.toml");

impl Folder {
    fn status(&self) -> Value {
        serde_json::from_str(&self.succeeds("status out/g --json")).unwrap()
    }
}

/// Shard and state of every process.
fn states(status: &Value) -> Vec<(&str, &str)> {
    let processes = status["processes"].as_array().unwrap().iter();
    processes
        .map(|process| {
            (
                process["shard"].as_str().unwrap(),
                process["state"].as_str().unwrap(),
            )
        })
        .collect()
}

#[test]
fn every_process_is_accounted_for() {
    let folder = Folder::new(GRID);
    let missing = folder.fails("status out/g");
    assert!(
        missing.starts_with("error: ") && missing.contains("out/g"),
        "{missing}"
    );

    // a process that runs, and is killed
    let mut child = folder
        .command("build g.toml --shard 0/3 --threads 1")
        .spawn()
        .unwrap();
    while !folder
        .out("g")
        .join(".splitsnow-runs/shard-0-of-3.json")
        .exists()
    {
        sleep(Duration::from_millis(5));
    }
    let status = folder.status();
    let process = &status["processes"][0];
    assert_eq!(states(&status), [("0/3", "running")]);
    assert_eq!(process["process"].as_u64(), Some(child.id().into()));
    assert_eq!(
        [&status["jobs"], &process["jobs"], &process["threads"]],
        [24, 8, 1]
    );
    assert!(process["since"].as_u64() <= process["seen"].as_u64());
    child.kill().unwrap();
    child.wait().unwrap();
    let status = folder.status();
    assert_eq!(states(&status), [("0/3", "killed")]);
    assert!(status["left"].as_u64() > Some(16));

    // one whose job cannot be stored, one that is stopped, and one that ends
    let obstacle = folder.out("g").join(".splitsnow-jobs/9");
    std::fs::create_dir_all(&obstacle).unwrap();
    let error = folder.fails("build g.toml --shard 1/3 --threads 1");
    std::fs::remove_dir(&obstacle).unwrap();
    let stopped = folder.run("build g.toml --shard 0/3 --threads 1 --stop-after 0.01s");
    assert_eq!(stopped.status.code(), Some(75));
    folder.succeeds("build g.toml --shard 2/3");
    let status = folder.status();
    let expected = [("0/3", "stopped"), ("1/3", "failed"), ("2/3", "finished")];
    assert_eq!(states(&status), expected);
    let message = status["processes"][1]["message"]
        .as_str()
        .unwrap()
        .to_owned();
    assert!(error.contains(&message), "{error}");
    let last = &status["processes"][2];
    assert_eq!([&last["jobs"], &last["done"], &last["run"]], [8, 8, 8]);
    assert!(last["rays"].as_u64() >= Some(8 * 20_000), "{last}");
    // again, with nothing to do
    folder.succeeds("build g.toml --shard 2/3");
    let status = folder.status();
    let last = &status["processes"][2];
    assert_eq!([&last["jobs"], &last["done"], &last["run"]], [8, 8, 0]);
    let text = folder.succeeds("status out/g");
    let lines: Vec<&str> = text.lines().collect();
    assert!(
        lines[0].contains(" of 24 jobs are done, ") && lines.len() == 4,
        "{text}"
    );
    assert!(lines[2].starts_with("shard 1/3      failed    "), "{text}");
    assert!(lines[2].ends_with(&message), "{text}");

    // damaged journals are left out; the build that compresses deletes all
    folder.write("out/g/.splitsnow-runs/shard-1-of-3.json", "{");
    assert_eq!(states(&folder.status()), [expected[0], expected[2]]);
    folder.succeeds("build g.toml");
    assert!(!folder.out("g").join(".splitsnow-runs").exists());
    let done = "24 of 24 jobs are done, 0 left\n";
    assert_eq!(folder.succeeds("status out/g"), done);
    assert_eq!(folder.succeeds("status out/g --watch"), done);
}

/// The job that compresses on a cluster names the shards with missing jobs, and simulates nothing.
#[test]
fn a_build_is_finished_or_its_missing_shards_are_named() {
    let folder = Folder::new(GRID);
    for shard in ["0/4", "2/4"] {
        folder.succeeds(&format!("build g.toml --shard {shard}"));
    }
    let job = folder.out("g").join(".splitsnow-jobs/7");
    let error = folder.fails("build g.toml --finish 4");
    let expected = "error: 12 of 24 jobs are missing, in the shards 1,3 of 4; nothing was simulated; to go on: run each of them with --shard I/4\n";
    assert_eq!(error, expected);
    assert!(!job.exists());
    // the command of the script, if `submit` has written it
    folder.write("out/g/slurm-array.sh", "");
    let error = folder.fails("build g.toml --finish 4");
    assert!(
        error.ends_with("to go on: sbatch --array=1,3 out/g/slurm-array.sh\n"),
        "{error}"
    );
    for shard in ["1/4", "3/4"] {
        folder.succeeds(&format!("build g.toml --shard {shard}"));
    }
    // a damaged file is found
    let bytes = std::fs::read(&job).unwrap();
    std::fs::write(&job, &bytes[1..]).unwrap();
    let error = folder.fails("build g.toml --finish 24");
    assert!(
        error.starts_with("error: 1 of 24 jobs are missing, in the shards 7 of 24; "),
        "{error}"
    );
    std::fs::write(&job, &bytes).unwrap();
    folder.succeeds("build g.toml --finish 4");
    assert!(folder.out("g").join("snow.safetensors").exists());
    assert_eq!(
        folder
            .run("build g.toml --finish 4 --shard 0/4")
            .status
            .code(),
        Some(2)
    );
}

/// The scripts for Slurm, which tests/cluster/slurm.py submits to a real one.
#[test]
fn scripts_for_slurm_hold_the_number_of_tasks() {
    let folder = Folder::new(GRID);
    let submit = "submit g.toml --seconds 0.01 --print --out it's --tasks 6 --time 90m --memory 700 -- --partition=long";
    let text = folder.succeeds(submit);
    for line in [
        "#SBATCH --array=0-5",
        "#SBATCH --time=90",
        "#SBATCH --mem=700M",
        "#SBATCH --partition=long",
    ] {
        assert!(text.lines().any(|other| other == line), "{line}: {text}");
    }
    let out = folder.0.path().canonicalize().unwrap().join("it's");
    let quoted = out.display().to_string().replace('\'', r"'\''");
    assert!(
        text.contains(&format!(
            "--out '{quoted}' --shard \"$SLURM_ARRAY_TASK_ID/6\" &\n"
        )),
        "{text}"
    );
    assert!(
        text.ends_with(&format!("--out '{quoted}' --finish 6\n")),
        "{text}"
    );
    assert_eq!(text.matches("#SBATCH --partition=long\n").count(), 2);
    assert!(!out.exists(), "nothing is written");
    let error = folder.fails("submit g.toml --seconds 0.01 --print --tasks 25");
    assert_eq!(
        error,
        "error: --tasks 25: the grid has only 24 jobs; give at most as many tasks\n"
    );
}
