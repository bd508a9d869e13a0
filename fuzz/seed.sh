#!/bin/sh
# Fills the corpora from the bundled scenes, small mesh files first.
set -eu
cd "$(dirname "$0")"
mkdir -p corpus/scene corpus/mesh corpus/layers corpus/texture corpus/checkpoint
for scene in ../scenes/*/scene.xml ../scenes/unit/*/scene.xml; do
	name=$(basename "$(dirname "$scene")")
	sed 's|\.\./\.\./assets|/nowhere|; s|\.\./assets|/nowhere|' "$scene" > "corpus/scene/$name.xml"
done
put() { { printf "$1"; cat; } > "corpus/mesh/$2"; }
printf 'v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 1\nvn 0 0 1\nf 1/1/1 2/1/1 -1/1/1\nf 1 2 3\nf 1//1 2//1 3//1\n' | put '\000' small.obj
printf 'ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nproperty float weight_0\nend_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n3 0 1 2 0.5\n' | put '\001' small.ply
put '\001' torus.ply < ../scenes/assets/torus_binary.ply
put '\001' colors.ply < ../scenes/assets/torus_colors.ply
put '\002' torus.serialized < ../scenes/assets/torus.serialized
printf 'v 0 0 0 # a\nv 2 0 \\\n0\nv 0.5 0.5 0\nv 0 2 0\nf 1 2 3 4\n' | put '\000' concave.obj
printf 'ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n4 0 1 2 3\n0 0 0\n2 0 0\n0.5 0.5 0\n0 2 0\n' | put '\001' faces-first.ply
cat > corpus/scene/old.xml <<'END'
<scene version="0.6.0"><integrator type="gpt"><integer name="maxDepth" value="3"/></integrator>
<sensor type="perspective"><transform name="toWorld"><lookAt origin="0,0,4" target="0,0,0"/></transform></sensor>
<shape type="sphere"><bsdf type="mixturebsdf"><string name="weights" value="0.5 0.4"/><bsdf type="coating"><bsdf type="phong"/></bsdf>
<bsdf type="ward"><float name="alphaU" value="0.3"/></bsdf></bsdf><animation name="toWorld"><transform time="0"/></animation></shape>
<emitter type="sunsky"><float name="stretch" value="1.2"/></emitter><include filename="nothing.xml"/></scene>
END
printf '\377\376' > corpus/scene/utf16.xml
iconv -t UTF-16LE corpus/scene/old.xml >> corpus/scene/utf16.xml
for image in sky.exr:000 bumps.png:001 holes.png:005; do
	{ printf "\\${image#*:}"; cat "../scenes/assets/${image%:*}"; } > "corpus/texture/${image%:*}"
done
# Small ones, which the program makes itself. The target adds the checksum.
fluxion=${FLUXION:-../target/release/fluxion}
for method in primal l2 frgr apr; do
	$fluxion render ../scenes/unit/diffuse/scene.xml --size 5x4 --spp 2 -q --method $method -o corpus/out.exr \
		--layers corpus/layers/$method.exr --checkpoint corpus/$method.ckpt
	head -c -4 corpus/$method.ckpt > corpus/checkpoint/$method.ckpt
done
$fluxion render ../scenes/unit/diffuse/scene.xml --size 5x4 --spp 40 -q --adaptive -o corpus/out.exr --checkpoint corpus/a.ckpt
head -c -4 corpus/a.ckpt > corpus/checkpoint/adaptive.ckpt
rm corpus/out.exr corpus/*.ckpt
