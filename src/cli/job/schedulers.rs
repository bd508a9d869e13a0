//! Files by which schedulers run the chunks of a job: a list of commands, a script for Slurm, a template of Open Job Description.

use std::path::Path;

use anyhow::Result;
use fluxion::files;
use serde_json::json;

/// Seconds from the request to stop to the kill: enough for running tiles and a checkpoint.
const GRACE: u32 = 120;

/// Writes all of them into the folder of a job, whose absolute path is `job`.
pub fn write(folder: &Path, job: &Path, chunks: usize) -> Result<()> {
    let quoted = format!("'{}'", job.display().to_string().replace('\'', r"'\''"));
    let command = |number| format!("fluxion job run {quoted} {number}\n");
    files::write(&folder.join("commands.txt"), (0..chunks).map(command).collect::<String>())?;
    files::write(&folder.join("slurm.sh"), slurm(&quoted, chunks))?;
    Ok(files::write(&folder.join("openjd.yaml"), openjd(job, chunks)?)?)
}

/// Submits an array of all chunks that are not complete, and a merge when it has ended. A chunk that was stopped is queued again.
fn slurm(job: &str, chunks: usize) -> String {
    format!(
        r#"#!/bin/sh
# Submits the {chunks} chunks of this job as an array, as far as they are not complete, and their merge after it. Options are those of
# sbatch, for the array: sh slurm.sh --partition=render --cpus-per-task=16 --time=1:00:00
set -eu
job={job}
missing=$(fluxion job status --missing "$job")
if [ -z "$missing" ]; then
	echo "all chunks are complete: fluxion job merge $job"
	exit
fi
array=$(sbatch --parsable --job-name=fluxion --array="$missing" --requeue --signal=TERM@{GRACE} --open-mode=append \
	--output="$job/slurm-%a.log" "$@" <<'EOF'
#!/bin/sh
srun fluxion job run {job} "$SLURM_ARRAY_TASK_ID"
code=$?
# Stopped, with all samples saved.
if [ $code = 75 ]; then
	scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit $code
EOF
)
merge=$(sbatch --parsable --job-name=fluxion-merge --dependency=afterany:"${{array%%;*}}" --open-mode=append --output="$job/slurm-merge.log" <<'EOF'
#!/bin/sh
exec srun fluxion job merge --partial {job}
EOF
)
echo "array $array, merge $merge"
"#
    )
}

/// A template with a task for every chunk, and a step that merges them.
fn openjd(job: &Path, chunks: usize) -> Result<String> {
    let script = |words: &[&str], chunk: Option<&str>| {
        let job = job.display().to_string();
        let args: Vec<_> = words.iter().copied().chain([job.as_str()]).chain(chunk).collect();
        let cancelation = json!({"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": GRACE});
        json!({"actions": {"onRun": {"command": "fluxion", "args": args, "cancelation": cancelation}}})
    };
    let last = chunks.saturating_sub(1);
    let range = if last == 0 { "0".to_owned() } else { format!("0-{last}") };
    let parameters = json!({"taskParameterDefinitions": [{"name": "Chunk", "type": "INT", "range": range}]});
    let render = script(&["job", "run"], Some("{{Task.Param.Chunk}}"));
    let template = json!({
        "specificationVersion": "jobtemplate-2023-09",
        "name": "fluxion",
        "steps": [
            {"name": "Render", "parameterSpace": parameters, "script": render},
            {"name": "Merge", "dependencies": [{"dependsOn": "Render"}], "script": script(&["job", "merge"], None)},
        ],
    });
    // JSON is YAML.
    Ok(serde_json::to_string_pretty(&template)? + "\n")
}
