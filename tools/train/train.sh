#!/bin/sh
# Everything from nothing to the weights of a method: models, scenes, frames, training, gates. What is there is kept, so an
# interrupted run goes on. Takes hours; FOLDER, from the repository's top, needs 30 GB.
#
#     tools/train/train.sh net|blend|gradnet|kernels FOLDER [SCENES]
set -eu
cd "$(dirname "$0")/../.."
method=$1
folder=$2
scenes=${3:-320}
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

# Trains and exports with the script of this name on the rest.
weights() {
	script=$1
	run=$folder/run-$2
	shift 2
	"$python" "tools/train/$script.py" train "$@" --run "$run"
	"$python" "tools/train/$script.py" export "$@" --run "$run"
}

# Frames with clean targets: half of the scenes at even powers of two, half at odd ones.
with_targets() {
	"$fluxion" dataset "$folder"/scenes/*["$1"]/scene.xml -o "$folder/frames-$2" --spp "$3" --size 128x128 --reference 256 \
		--target l2 --half --layers features --method frgr --notes --resume
}

# Windows of 96x96 pixels in the middle of smaller and larger films, so that textures and outlines are as coarse and as fine as
# in images of any size: of scenes whose numbers end so, at these sample counts, with the images that are blended.
windows() {
	corner=$((($3 - 96) / 2))
	"$fluxion" dataset "$folder"/scenes/*["$1"]/scene.xml -o "$folder/windows-$3-$1" --spp "$2" --size "$3x$3" \
		--crop "$corner,$corner,96x96" --reference 96 --target l2 --half --layers features --method frgr \
		--method frgr:denoiser=oidn --method net:image=safe --notes --resume
}

# Larger frames with differences, their targets with as many samples; smaller ones of the scenes that are kept apart.
with_differences() {
	methods="--method l1 --method frgr --notes"
	for scene in "$folder"/scenes/*; do
		case $scene in
		*9[0-9]) set -- apart --size 128x128 --reference 256 --method l2 --method control_variate --method least_trimmed ;;
		*) set -- whole --size 256x256 --reference 64 ;;
		esac
		to=$folder/frames-$1
		shift
		# shellcheck disable=SC2086 # several options
		"$fluxion" dataset "$scene/scene.xml" -o "$to" --spp 4,16,64 --half --layers features,gradients --target l2 $methods "$@" \
			--resume -q
	done
}

case $method in
gradnet)
	with_differences
	weights gradnet gradnet-own "$folder/frames-whole" "$folder/frames-apart" --preset own
	weights gradnet gradnet-paper "$folder/frames-whole" "$folder/frames-apart" --preset paper --width 16
	;;
kernels)
	"$python" tools/train/kernel_frames.py "$folder/scenes" "$folder/frames-kernels" --fluxion "$fluxion"
	weights kernels kernels "$folder/frames-kernels"
	;;
net)
	with_targets 02468 even 4,16,64
	with_targets 13579 odd 2,8,32
	weights net net "$folder/frames-even" "$folder/frames-odd"
	with_differences
	weights differences differences "$folder/frames-whole" "$folder/frames-apart"
	;;
blend)
	for film in 128-02 256-46 512-8; do
		windows "${film#*-}" 4,16,64 "${film%-*}"
	done
	for film in 128-13 256-5 512-79; do
		windows "${film#*-}" 2,8,32 "${film%-*}"
	done
	weights blend blend "$folder"/windows-*
	;;
*)
	echo "unknown method: $method" >&2
	exit 2
	;;
esac
