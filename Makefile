# Two commands do everything on Debian 12 and 13: `make demo` and `make test`.

# What the build links against, and what the tests and CI call. apt-get names, the same on both releases.
PACKAGES = g++ pkg-config libclang-dev libembree-dev libopenimageio-dev
# A test opens the report in it.
TEST_PACKAGES = chromium
SCENE = scenes/cornell-box/scene.xml

.PHONY: demo test packages check licences wheel deb dist memcheck train-net train-blend train-gradnet train-kernels

demo: packages
	cargo build --release
	mkdir -p demo
	target/release/fluxion render $(SCENE) --size 512x512 --spp 32 -o demo/cornell-box.exr -o demo/cornell-box.png \
		--layers demo/cornell-box-layers.exr
	@echo "look at demo/cornell-box.png; demo/cornell-box.exr holds the radiance"

# The profile `checked` optimises like `release`, but not across crates, which halves the time of building the tests.
test: packages
	@sh .ci/packages $(TEST_PACKAGES)
	cargo test --profile checked
	cargo build --profile checked
	target/checked/fluxion validate
	target/checked/fluxion stress

# Format, lints and documentation, as CI checks them.
check: packages
	cargo fmt --all --check
	cargo clippy --profile checked --all-targets -- -D warnings
	cargo clippy -p fluxion-python -- -D warnings
	cargo check -p fluxion-fuzz
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps

# Licences and sources of all dependencies. Advisories are not looked at here, since that takes an internet connection:
# `cargo deny check advisories` or `cargo audit` does.
licences:
	@command -v cargo-deny > /dev/null || cargo install cargo-deny --locked
	cargo deny check licenses bans sources

# The Python module with everything it needs in it, tested in an environment of its own.
wheel: packages
	@sh .ci/packages python3-venv
	cargo build --release
	python/build target/wheels
	python/check target/wheels target/release/fluxion

# A package for this release of Debian, in target/debian.
deb: packages
	@command -v cargo-deb > /dev/null || cargo install cargo-deb --locked
	cargo build --release
	tools/package/extras target/release/fluxion target/package
	cargo deb --no-build

# A tarball for people without cargo, with Embree and TBB in it, in target/dist.
dist: packages
	tools/package/dist target/dist

# Small renders under valgrind.
memcheck: packages
	@sh .ci/packages valgrind
	cargo build --release
	tools/memcheck/run

# Weights of learned methods from nothing, in training/: hours, resumable. Building and using Fluxion needs none of it.
train-net train-blend train-gradnet train-kernels: packages
	@sh .ci/packages python3-venv
	cargo build --release
	tools/train/train.sh $(@:train-%=%) training

# Installs what is missing, through sudo when not root. Elsewhere than on Debian it says what is needed.
packages:
	@sh .ci/packages $(PACKAGES)
