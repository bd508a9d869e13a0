//! Files by which schedulers run the chunks of a job: a list of commands, a script for Slurm, a template of Open Job Description.

use std::ops::Range;
use std::path::Path;

use serde_json::json;

use super::ranges::ranges;
use crate::error::{Error, Result};
use crate::files;

/// Seconds from the request to stop to the kill: enough for running tiles and a checkpoint.
const GRACE: u32 = 120;

/// Writes all of them into the folder of a job, whose absolute path is `job`, with the numbers of the chunks of one round or of two, and
/// with options of the commands that run them.
pub fn write(folder: &Path, job: &Path, rounds: &[Range<usize>; 2], options: &[String]) -> Result<()> {
    let run: String =
        std::iter::once("fluxion job run").chain(options.iter().map(String::as_str)).collect::<Vec<_>>().join(" ");
    let quoted = format!("'{}'", job.display().to_string().replace('\'', r"'\''"));
    for (round, name) in rounds.iter().zip(["commands.txt", "commands-2.txt"]).filter(|(round, _)| !round.is_empty()) {
        let command = |number| format!("{run} {quoted} {number}\n");
        files::write(&folder.join(name), round.clone().map(command).collect::<String>())?;
    }
    files::write(&folder.join("slurm.sh"), slurm(&quoted, &run, rounds))?;
    files::write(&folder.join("openjd.yaml"), openjd(job, rounds, options)?)
}

/// Submits an array of all chunks that are not complete, and a merge when it has ended. A chunk that was stopped is queued again. Of two
/// rounds the second waits until its samples have been allocated.
fn slurm(job: &str, run: &str, rounds: &[Range<usize>; 2]) -> String {
    let chunks = rounds[1].end;
    let second = if rounds[1].is_empty() { String::new() } else { second_round(&rounds[1]) };
    format!(
        r#"#!/bin/sh
# Submits the {chunks} chunks of this job as an array, as far as they are not complete, and their merge after it. Options are those of
# sbatch, for the array: sh slurm.sh --partition=render --cpus-per-task=16 --time=1:00:00
set -eu
job={job}

# chunks NUMBERS [OPTION...]: number of the array that renders them.
chunks() {{
	numbers=$1
	shift
	sbatch --parsable --job-name=fluxion --array="$numbers" --requeue --signal=TERM@{GRACE} --open-mode=append \
		--output="$job/slurm-%a.log" "$@" <<'EOF'
#!/bin/sh
srun {run} {job} "$SLURM_ARRAY_TASK_ID"
code=$?
# Stopped, with all samples saved.
if [ $code = 75 ]; then
	scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit $code
EOF
}}

# step NAME [OPTION...]: number of the task that carries out `fluxion job NAME`.
step() {{
	name=$1
	shift
	FLUXION_STEP="$name" sbatch --export=ALL --parsable --job-name="fluxion-$name" --open-mode=append --output="$job/slurm-$name.log" "$@" <<'EOF'
#!/bin/sh
case $FLUXION_STEP in
allocate) exec srun fluxion job allocate {job} ;;
merge) exec srun fluxion job merge --partial {job} ;;
esac
EOF
}}

missing=$(fluxion job status --missing "$job")
{second}if [ -z "$missing" ]; then
	echo "all chunks are complete: fluxion job merge $job"
	exit
fi
array=$(chunks "$missing" "$@")
merge=$(step merge --dependency=afterany:"${{array%%;*}}")
echo "array $array, merge $merge"
"#
    )
}

/// The part of the script that renders a first round and allocates the second, unless that has been done.
fn second_round(round: &Range<usize>) -> String {
    format!(
        r#"if [ ! -e "$job/allocated.json" ]; then
	if [ -n "$missing" ]; then
		first=$(chunks "$missing" "$@")
		allocation=$(step allocate --dependency=afterany:"${{first%%;*}}")
	else
		allocation=$(step allocate)
	fi
	missing={}
	set -- "$@" --dependency=afterok:"${{allocation%%;*}}" --kill-on-invalid-dep=yes
fi
"#,
        range(round)
    )
}

/// Numbers as schedulers take them.
fn range(numbers: &Range<usize>) -> String {
    ranges(&numbers.clone().collect::<Vec<_>>())
}

/// A template with a task for every chunk, and a step that merges them; of two rounds with one that allocates the second.
fn openjd(job: &Path, rounds: &[Range<usize>; 2], options: &[String]) -> Result<String> {
    let script = |words: &[&str], chunk: Option<&str>| {
        let job = job.display().to_string();
        let args: Vec<_> = words.iter().copied().chain([job.as_str()]).chain(chunk).collect();
        let cancelation = json!({"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": GRACE});
        json!({"actions": {"onRun": {"command": "fluxion", "args": args, "cancelation": cancelation}}})
    };
    let render = |name: &str, round: &Range<usize>| {
        let parameters = json!({"taskParameterDefinitions": [{"name": "Chunk", "type": "INT", "range": range(round)}]});
        let words: Vec<_> = ["job", "run"].into_iter().chain(options.iter().map(String::as_str)).collect();
        let run = script(&words, Some("{{Task.Param.Chunk}}"));
        json!({"name": name, "parameterSpace": parameters, "script": run})
    };
    let mut steps = vec![render("Render", &rounds[0])];
    if !rounds[1].is_empty() {
        steps.push(json!({"name": "Allocate", "script": script(&["job", "allocate"], None)}));
        steps.push(render("RenderSecond", &rounds[1]));
    }
    steps.push(json!({"name": "Merge", "script": script(&["job", "merge"], None)}));
    for k in 1..steps.len() {
        steps[k]["dependencies"] = json!([{"dependsOn": steps[k - 1]["name"]}]);
    }
    let template = json!({"specificationVersion": "jobtemplate-2023-09", "name": "fluxion", "steps": steps});
    // JSON is YAML.
    let text = serde_json::to_string_pretty(&template).map_err(|error| Error::backend("json", error))?;
    Ok(text + "\n")
}
