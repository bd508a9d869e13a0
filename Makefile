# Two commands do everything on Debian 12 and 13: `make demo` and `make test`.

# What the build links against, and what the tests and CI call. apt-get names, the same on both releases.
PACKAGES = g++ pkg-config libclang-dev libembree-dev libopenimageio-dev
# A test opens the report in the one, and compares tables with their figures by the other.
TEST_PACKAGES = chromium python3
SCENE = scenes/cornell-box/scene.xml

# Folder of public scenes, as NAME/scene.xml, for references and figures; hours that references may take; one figure by name.
SCENES =
HOURS = 1
NAME =

.PHONY: references figures figures-status demo test packages check licences wheel deb dist memcheck train-net train-blend train-gradnet train-kernels

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

# References that the figures need, in measured/: as good as the hours make them, what is there is continued.
references: measured/venv/ready
	cargo build --release
	measured/venv/bin/python tools/figures references --scenes "$(SCENES)" --hours $(HOURS)

# Measures what is stale, or the figure NAME, and prints the tables of all documents.
figures: measured/venv/ready
	cargo build --release
	measured/venv/bin/python tools/figures run $(NAME) --scenes "$(SCENES)"

figures-status:
	@python3 tools/figures status

measured/venv/ready: tools/figures/requirements.txt | packages
	@sh .ci/packages python3-venv libllvm19
	python3 -m venv measured/venv
	measured/venv/bin/pip install -q -r tools/figures/requirements.txt
	touch $@

# Installs what is missing, through sudo when not root. Elsewhere than on Debian it says what is needed.
packages:
	@sh .ci/packages $(PACKAGES)
