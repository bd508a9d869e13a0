//! The report in a browser: headless Chromium, as `make test` installs it.

use std::path::{Path, PathBuf};
use std::process::Command;

use fluxion::bench::{LeftOut, Record, Results, Seconds};
use fluxion::image::Image;
use fluxion::internals::math::vec3;
use fluxion::report::{Page, Shown, View, changes};

fn record(method: &str, budget: u32, seed: u64, error: f64) -> Record {
    Record {
        scene: "room".into(),
        method: method.into(),
        budget: format!("{budget}s"),
        seed,
        width: 64,
        height: 48,
        fingerprint: "0".into(),
        spp: 16 * budget,
        seconds: Seconds { total: f64::from(budget), ..Seconds::default() },
        metrics: ["relmse", "smape", "flip", "ms_ssim"].map(|name| (name.to_owned(), error)).into(),
        negative: 0.0,
        rejected: 0,
        peak_bytes: 0,
        floor: Some(1e-6),
        machine: "a </script> machine".into(),
        version: "1".into(),
    }
}

fn results(good: f64) -> Results {
    let mut results = Results::default();
    for budget in [1, 2, 4, 8] {
        for seed in [1, 2, 3] {
            let spread = 1.0 + 0.02 * (seed as f64 - 2.0);
            results.records.push(record("primal", budget, seed, spread / f64::from(budget)));
            results.records.push(record("good", budget, seed, good * spread / f64::from(budget)));
        }
    }
    let text = |text: &str| text.to_owned();
    let left = LeftOut { scene: text("room"), method: text("slow"), budget: text("1s"), reason: text("it is slow") };
    results.left_out.push(left);
    results
}

fn view() -> View {
    let image = |tint: f32| Image::from_rgb(64, 48, |x, y| vec3(tint, x as f32 / 64.0, y as f32 / 48.0));
    let shown = |label: &str, tint| Shown { label: label.into(), picture: image(tint).into() };
    View { name: "room".into(), reference: image(0.5).into(), images: vec![shown("primal", 0.9), shown("good", 0.45)] }
}

/// What the page does when it is used, as lines of text.
const PROBE: &str = r##"
<script>
window.addEventListener("load", () => setTimeout(() => {
  const lines = [];
  const say = (name, value) => lines.push(`${name}=${value}`);
  const dots = (method) => [...document.querySelectorAll(`g[data-method="${method}"] circle`)];
  say("dots", dots("good").map((dot) => [dot.dataset.seconds, (+dot.dataset.error).toFixed(6)].join(":")).join(","));
  const [first, last] = [dots("primal")[0], dots("primal")[3]];
  // Errors that halve as the time doubles lie on a line that falls.
  say("falls", +first.getAttribute("cx") < +last.getAttribute("cx") && +first.getAttribute("cy") < +last.getAttribute("cy"));
  say("rows", [...document.querySelectorAll("#summary tr")].slice(1).map((row) => row.children[0].textContent
    + ":" + row.children[1].textContent).join(","));
  const cells = [...document.querySelectorAll("#errors tr")].slice(1).map((row) => [...row.children]);
  say("errors by scene", cells.length + ":" + cells[0].length + ":" + cells.flat().filter((cell) => cell.className).length);
  say("changes", [...document.querySelectorAll("#changes tr")].slice(1).map((row) => row.lastChild.textContent).join(","));
  const button = document.querySelector(".legend button");
  button.click();
  say("faded", document.querySelectorAll("g.faded").length);
  const metric = document.getElementById("metric");
  metric.value = "2";
  metric.dispatchEvent(new Event("change"));
  say("plots", document.querySelectorAll(".plot circle").length);
  const slider = document.querySelector(".viewer input[type=range]");
  const above = document.querySelectorAll(".stage img")[1];
  say("before", above.style.clipPath);
  slider.value = 25;
  slider.dispatchEvent(new Event("input"));
  say("after", above.style.clipPath);
  say("size", above.naturalWidth + "x" + above.naturalHeight);
  const selects = document.querySelectorAll(".viewer select");
  const source = above.src;
  selects[0].value = 0;
  selects[0].dispatchEvent(new Event("change"));
  say("switched", above.src !== source);
  const canvas = document.querySelector(".crops canvas");
  const pixel = canvas.getContext("2d").getImageData(20, 20, 1, 1).data;
  say("crop", pixel[3] === 255 && pixel[0] > 0);
  say("outside", [...document.querySelectorAll("[src],link[href]")].filter((e) =>
    !(e.src || e.href).startsWith("data:")).length);
  document.body.innerHTML = "<pre id=probe>" + lines.join("\n") + "\nerrors=" + window.failures.join(";") + "</pre>";
}, 200));
</script>
"##;

/// Put before anything else, to miss no error.
const WATCH: &str = r#"<script>
window.failures = [];
window.addEventListener("error", (event) => window.failures.push(event.message));
console.error = console.warn = (...all) => window.failures.push(all.join(" "));
</script>"#;

fn chromium() -> PathBuf {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path).flat_map(|folder| names.map(|name| folder.join(name)));
    found.into_iter().find(|file| file.is_file()).expect("chromium is missing: `make test` installs it")
}

/// The lines that the probe leaves in a page.
fn probe(folder: &Path, html: &str) -> Vec<(String, String)> {
    let file = folder.join("page.html");
    let watched = html.replacen("<meta", &format!("{WATCH}<meta"), 1);
    std::fs::write(&file, watched.replace("</body>", &format!("{PROBE}</body>"))).unwrap();
    let output = Command::new(chromium())
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--virtual-time-budget=4000",
            "--dump-dom",
        ])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .arg(format!("file://{}", file.display()))
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout);
    let text = dom.split("<pre id=\"probe\">").nth(1).and_then(|rest| rest.split("</pre>").next());
    let text = text.unwrap_or_else(|| panic!("the page has not run:\n{}", String::from_utf8_lossy(&output.stderr)));
    let lines = text.lines().filter_map(|line| line.split_once('='));
    lines.map(|(name, value)| (name.to_owned(), value.to_owned())).collect()
}

#[test]
fn the_page_shows_the_right_numbers_and_its_slider_moves() {
    let results = results(0.25);
    let changes = changes(&results, &self::results(0.5), "relmse");
    let page = Page { title: "a <title>".into(), results: Some(&results), changes, views: vec![view()] };
    let folder = tempfile::tempdir().unwrap();
    let lines = probe(folder.path(), &page.html().unwrap());
    let get = |name: &str| lines.iter().find(|(key, _)| key == name).map_or("", |(_, value)| value.as_str());
    assert_eq!(get("errors"), "");
    assert_eq!(get("dots"), "1:0.249999,2:0.124999,4:0.062499,8:0.031249");
    assert_eq!(get("falls"), "true");
    assert_eq!(get("rows"), "good:0.25,primal:1");
    // Two methods at four times; with such a floor nothing is grey.
    assert_eq!(get("errors by scene"), "8:8:0");
    let expected = ["within noise", "better"].repeat(4).join(",");
    assert_eq!(get("changes"), expected);
    assert_eq!(get("faded"), "1");
    assert_eq!(get("plots"), "8");
    assert_eq!((get("before"), get("after")), ("inset(0px 50% 0px 0px)", "inset(0px 75% 0px 0px)"));
    assert_eq!(get("size"), "64x48");
    assert_eq!((get("switched"), get("crop"), get("outside")), ("true", "true", "0"));
}

#[test]
fn one_seed_is_no_evidence_of_a_change() {
    let mut few = results(0.5);
    few.records.retain(|record| record.seed == 1);
    assert!(changes(&few, &results(0.25), "relmse").iter().all(|change| change.verdict == 0));
}

#[test]
fn results_survive_their_file() {
    let folder = tempfile::tempdir().unwrap();
    let (file, results) = (folder.path().join("results.json"), results(0.5));
    std::fs::write(&file, results.json().unwrap()).unwrap();
    assert_eq!(Results::load(&file).unwrap(), results);
    let csv = results.csv().unwrap();
    assert_eq!(csv.lines().count(), 1 + results.records.len());
    assert!(csv.starts_with("scene,method,budget,seed,") && csv.contains("room,good,8s,3,64,48,128"));
    std::fs::write(&file, "{}").unwrap();
    assert!(Results::load(&file).unwrap_err().to_string().contains("results.json"));
}
