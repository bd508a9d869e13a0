#!/bin/sh
# Everything from nothing to the weights of `blend`: models, scenes, frames, training, gates. What is there is kept, so an
# interrupted run goes on. Takes hours; FOLDER, from the repository's top, needs 10 GB.
#
#     tools/train/blend.sh FOLDER [SCENES]
set -eu
cd "$(dirname "$0")/../.."
folder=$1
scenes=${2:-227}
fluxion=target/release/fluxion
mkdir -p "$folder"
if [ ! -e "$folder/venv/ready" ]; then
	python3 -m venv "$folder/venv"
	"$folder/venv/bin/pip" install -q torch numpy openimageio safetensors pyoidn
	touch "$folder/venv/ready"
fi
export VIRTUAL_ENV="$folder/venv"
python=$folder/venv/bin/python
[ -e "$folder/models/models.json" ] || "$python" tools/train/models.py "$folder/models"
"$python" tools/train/scenes.py "$folder/models" "$folder/scenes" --count "$scenes" --fluxion "$fluxion"

frames() {
	"$fluxion" dataset "$folder"/scenes/*["$1"]/scene.xml -o "$folder/frames-$2" --spp "$3" --size 128x128 --reference 256 \
		--target l2 --half --layers features --method frgr --method frgr:denoiser=oidn --notes --resume
}
# Half of the scenes at even powers of two, half at odd ones.
frames 02468 even 4,16,64
frames 13579 odd 2,8,32
blend() {
	frames="$folder/frames-even $folder/frames-odd"
	# shellcheck disable=SC2086 # two folders
	"$python" tools/train/blend.py train "$1" $frames --run "$folder/blend-$1"
	# shellcheck disable=SC2086
	"$python" tools/train/blend.py export "$1" $frames --run "$folder/blend-$1"
}
blend own
blend oidn
