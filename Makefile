# Two commands matter: `make run` and `make test`.

ADDR ?= 127.0.0.1:8080
VOLUME ?= data/visible-human-head.nrrd
ARGS ?=

.PHONY: help run test vulkan lint deny advisories fmt clean
.DEFAULT_GOAL := help

help: ## List the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-11s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

run: vulkan ## Build and start the server, which says where it is (ADDR, VOLUME: one or more files, ARGS: any other flags)
	cargo run --release --locked -- serve --addr $(ADDR) $(foreach file,$(VOLUME),--volume $(file)) $(ARGS)

test: vulkan lint deny ## All checks and all tests
	cargo test --locked
	@scripts/test-viewer.sh

vulkan: ## A Vulkan driver; installs Mesa's by apt-get where there is none
	@scripts/ensure-vulkan.sh

# Clippy and the documentation share one set of checked dependencies; the tests compile theirs, in the same profile.
lint: ## Formatting, clippy and the documentation, warnings are errors
	cargo fmt --check
	cargo clippy --locked --all-targets -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --no-deps --lib

deny: ## Licences, banned crates and sources of the dependencies
	@scripts/cargo-deny.sh bans licenses sources

advisories: ## Known vulnerabilities in the dependencies (fetches the RustSec database)
	@scripts/cargo-deny.sh advisories

fmt: ## Format the code
	cargo fmt

clean: ## Remove everything built
	cargo clean
