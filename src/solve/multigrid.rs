//! Conjugate gradients on weighted graphs, preconditioned by multigrid.
//!
//! Nodes are joined along their strongest edges, three times in pairs for each level, so that no coarse node stands for
//! both sides of a weak edge: weights may jump by many orders of magnitude. Coarse problems are solved by two steps
//! of conjugate gradients each (the K-cycle of Notay 2010), which makes up for the constant interpolation.

use rayon::prelude::*;

use super::graph::{ALONE, CHUNK, Graph, MEMBERS, Quad};

/// Graphs of fewer nodes are solved directly.
const DIRECT: usize = 64;

/// Most nodes that may be visited on a level, of those of the finest, for two steps there.
const WORK: u64 = 4;

/// Damping of Jacobi smoothing: below one, so that it is a contraction in the energy norm.
const DAMPING: f32 = 0.7;

/// Most steps of the outer iteration.
const STEPS: usize = 200;

/// Steps without progress after which rounding is all that is left: where the first guess was as good as it gets, no
/// residual can be brought down to a share of its first one.
const PATIENCE: u32 = 12;

struct GridLevel {
    graph: Graph,
    /// Node of the next level that stands for each node.
    joined: Vec<u32>,
    /// Nodes that each node of the next level stands for.
    members: Vec<[u32; MEMBERS]>,
}

/// A graph with its coarser versions.
pub struct Multigrid {
    levels: Vec<GridLevel>,
    coarsest: Graph,
    /// Cholesky factor of the coarsest matrix, row by row; none when that has too many nodes, which only happens
    /// when no two of them belong together.
    factor: Option<Vec<f64>>,
}

/// Result of [`Multigrid::solve`].
pub struct Solved {
    /// The solutions.
    pub x: Vec<Quad>,
    /// Steps that were taken.
    pub steps: usize,
}

/// A level's vectors, kept between steps.
#[derive(Default)]
struct Vectors {
    /// Approximate solution for a residual, before and after smoothing.
    rough: Vec<Quad>,
    smooth: Vec<Quad>,
    /// Search direction, and the matrix times it.
    direction: Vec<Quad>,
    image: Vec<Quad>,
}

impl Multigrid {
    /// Coarsens until little is left.
    pub fn new(graph: Graph) -> Self {
        let mut levels = Vec::new();
        let mut finest = graph;
        while finest.len() > DIRECT {
            let (coarse, joined) = finest.coarsen();
            if coarse.is_empty() || coarse.len() * 10 > finest.len() * 9 {
                break;
            }
            let mut members = vec![[ALONE; MEMBERS]; coarse.len()];
            for (i, &to) in joined.iter().enumerate().filter(|(_, to)| **to != ALONE) {
                let slots = &mut members[to as usize];
                let free = slots.iter().position(|&slot| slot == ALONE).unwrap_or(MEMBERS - 1);
                slots[free] = i as u32;
            }
            levels.push(GridLevel { graph: finest, joined, members });
            finest = coarse;
        }
        let factor = (finest.len() <= DIRECT).then(|| cholesky(&finest));
        Self { levels, coarsest: finest, factor }
    }

    /// Solves for another matrix of the same size from now on. Coarser versions stay those of the old one: good as long as
    /// strong edges stay strong.
    pub fn replace(&mut self, graph: Graph) {
        match self.levels.first_mut() {
            Some(level) => level.graph = graph,
            None => *self = Self::new(graph),
        }
    }

    fn graph(&self, level: usize) -> &Graph {
        self.levels.get(level).map_or(&self.coarsest, |level| &level.graph)
    }

    /// Solves for `b`, starting at `x`, until the residuals in the preconditioner's norm have fallen by `tolerance`.
    pub fn solve(&self, b: &[Quad], mut x: Vec<Quad>, tolerance: f64) -> Solved {
        // Many short parallel loops follow: entering the thread pool once is faster than once for each.
        rayon::scope(|_| {
            let mut residual = vec![[0.0; 4]; b.len()];
            let graph = self.graph(0);
            each(&mut residual, |i| graph.residual(i, b, &x));
            let mut vectors: Vec<Vectors> = (0..=self.levels.len()).map(|_| Vectors::default()).collect();
            let steps = self.descend(0, &mut residual, &mut x, (STEPS, tolerance), &mut vectors);
            Solved { x, steps }
        })
    }

    /// Flexible conjugate gradients: right under a preconditioner that is not quite linear. Returns the steps taken.
    fn descend(
        &self,
        level: usize,
        residual: &mut [Quad],
        x: &mut [Quad],
        (limit, tolerance): (usize, f64),
        vectors: &mut [Vectors],
    ) -> usize {
        let graph = self.graph(level);
        let mut direction = std::mem::take(&mut vectors[0].direction);
        let mut image = std::mem::take(&mut vectors[0].image);
        direction.resize(residual.len(), [0.0; 4]);
        image.resize(residual.len(), [0.0; 4]);
        let (mut start, mut curve) = ([0.0; 4], [0.0; 4]);
        let mut steps = 0;
        // Least share of its first energy that the worst channel had, and steps since.
        let (mut least, mut idle) = (f64::INFINITY, 0);
        while steps < limit {
            self.precondition(level, residual, vectors);
            let z = &vectors[0].smooth;
            let energy = dot(residual, z);
            if steps == 0 {
                start = energy;
            }
            let worst = (0..4).map(|c| ratio(energy[c], start[c])).fold(0.0, f64::max);
            idle = if worst < 0.9 * least { 0 } else { idle + 1 };
            least = least.min(worst);
            if worst <= tolerance * tolerance || idle > PATIENCE {
                break;
            }
            if steps == 0 {
                each(&mut direction, |i| z[i]);
            } else {
                let overlap = dot(z, &image);
                let beta = [0, 1, 2, 3].map(|c| ratio(overlap[c], curve[c]) as f32);
                update(&mut direction, |i, d| std::array::from_fn(|c| z[i][c] - beta[c] * d[c]));
            }
            each(&mut image, |i| graph.row(i, &direction));
            curve = dot(&direction, &image);
            // The residual is orthogonal to the last direction, so its product with this one is the energy.
            let alpha = [0, 1, 2, 3].map(|c| ratio(energy[c], curve[c]) as f32);
            update(x, |i, x| std::array::from_fn(|c| x[c] + alpha[c] * direction[i][c]));
            update(residual, |i, r| std::array::from_fn(|c| r[c] - alpha[c] * image[i][c]));
            steps += 1;
        }
        (vectors[0].direction, vectors[0].image) = (direction, image);
        steps
    }

    /// Puts an approximate solution for a residual into the level's `smooth`.
    fn precondition(&self, at: usize, b: &[Quad], vectors: &mut [Vectors]) {
        let Some(level) = self.levels.get(at) else {
            vectors[0].smooth = self.direct(b);
            return;
        };
        let graph = &level.graph;
        let (this, deeper) = vectors.split_at_mut(1);
        let Vectors { rough, smooth, .. } = &mut this[0];
        rough.resize(b.len(), [0.0; 4]);
        smooth.resize(b.len(), [0.0; 4]);
        let relax = |i: usize| DAMPING / graph.diagonal()[i];
        each(rough, |i| b[i].map(|b| relax(i) * b));
        let mut coarse = vec![[0.0; 4]; level.members.len()];
        each(&mut coarse, |k| {
            let members = level.members[k].iter().filter(|&&i| i != ALONE);
            members.fold([0.0; 4], |sum: Quad, &i| {
                let r = graph.residual(i as usize, b, rough);
                std::array::from_fn(|c| sum[c] + r[c])
            })
        });
        let correction = if at + 1 == self.levels.len() {
            self.direct(&coarse)
        } else {
            let mut correction = vec![[0.0; 4]; coarse.len()];
            // Two steps on every level visit the next one twice as often: where levels hardly shrink, all of them together
            // would take time that doubles from one to the next.
            let work = (coarse.len() as u64) << (at + 1).min(32);
            let steps = if work <= WORK * self.graph(0).len() as u64 { 2 } else { 1 };
            self.descend(at + 1, &mut coarse, &mut correction, (steps, 0.25), deeper);
            correction
        };
        update(rough, |i, x| match level.joined[i] {
            ALONE => *x,
            to => std::array::from_fn(|c| x[c] + correction[to as usize][c]),
        });
        each(smooth, |i| {
            let r = graph.residual(i, b, rough);
            std::array::from_fn(|c| rough[i][c] + relax(i) * r[c])
        });
    }

    /// Solves on the coarsest level.
    fn direct(&self, b: &[Quad]) -> Vec<Quad> {
        let n = b.len();
        let Some(l) = &self.factor else {
            return b.iter().zip(self.coarsest.diagonal()).map(|(b, d)| b.map(|b| b / d)).collect();
        };
        let mut x: Vec<[f64; 4]> = b.iter().map(|b| b.map(f64::from)).collect();
        let mut eliminate = |i: usize, others: std::ops::Range<usize>, factor: &dyn Fn(usize) -> f64| {
            let known = others.fold([0.0; 4], |sum: [f64; 4], j| std::array::from_fn(|c| sum[c] + factor(j) * x[j][c]));
            x[i] = std::array::from_fn(|c| (x[i][c] - known[c]) / l[i * n + i]);
        };
        (0..n).for_each(|i| eliminate(i, 0..i, &|j| l[i * n + j]));
        (0..n).rev().for_each(|i| eliminate(i, i + 1..n, &|j| l[j * n + i]));
        x.iter().map(|x| x.map(|x| x as f32)).collect()
    }
}

/// Computes every value, in parallel.
fn each(out: &mut [Quad], value: impl Fn(usize) -> Quad + Sync) {
    in_chunks(out, &|first, chunk| (first..).zip(chunk).for_each(|(i, out)| *out = value(i)));
}

/// Replaces every value by a function of it, in parallel.
fn update(out: &mut [Quad], value: impl Fn(usize, &Quad) -> Quad + Sync) {
    in_chunks(out, &|first, chunk| (first..).zip(chunk).for_each(|(i, out)| *out = value(i, out)));
}

/// Works on chunks in parallel, each with the number of its first value. All callers share its code.
fn in_chunks(out: &mut [Quad], work: &(dyn Fn(usize, &mut [Quad]) + Sync)) {
    out.par_chunks_mut(CHUNK).enumerate().for_each(|(k, chunk)| work(k * CHUNK, chunk));
}

fn cholesky(graph: &Graph) -> Vec<f64> {
    let n = graph.len();
    let mut l = vec![0.0; n * n];
    for i in 0..n {
        graph.edges(i).iter().for_each(|&(j, weight)| l[i * n + j as usize] = -f64::from(weight));
        // A hair more than the diagonal: without any screening the matrix is singular.
        l[i * n + i] = f64::from(graph.diagonal()[i]) * (1.0 + 1e-7);
    }
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| l[i * n + k] * l[j * n + k]).sum();
            let rest = l[i * n + j] - known;
            l[i * n + j] = if i == j { rest.max(1e-300).sqrt() } else { rest / l[j * n + j] };
        }
    }
    l
}

fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// Inner products, channel by channel; summed in the same order on any number of threads.
fn dot(x: &[Quad], y: &[Quad]) -> [f64; 4] {
    let part = |(x, y): (&[Quad], &[Quad])| {
        x.iter()
            .zip(y)
            .fold([0.0; 4], |sum: [f64; 4], (x, y)| std::array::from_fn(|c| sum[c] + f64::from(x[c]) * f64::from(y[c])))
    };
    let parts: Vec<[f64; 4]> = x.par_chunks(CHUNK).zip(y.par_chunks(CHUNK)).map(part).collect();
    parts.iter().fold([0.0; 4], |sum, part| std::array::from_fn(|c| sum[c] + part[c]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Edges;
    use crate::math::rng::{combine, unit};

    fn random(seed: u64, i: usize) -> f32 {
        unit(combine(seed, i as u64))
    }

    /// A grid whose edge weights span `decades` powers of ten, in patches and at random.
    fn grid(width: usize, height: usize, decades: f32, screen: f32) -> Graph {
        let n = width * height;
        let patch = |i: usize| random(9, (i / width / 7) * 1000 + i % width / 5);
        let weight = |seed: u64, i: usize| 10f32.powf(decades * (0.7 * patch(i) + 0.3 * random(seed, i) - 0.5));
        let across: Vec<f32> = (0..n).map(|i| weight(1, i)).collect();
        let down: Vec<f32> = (0..n).map(|i| weight(2, i)).collect();
        let edges = Edges::cross((width, height));
        let of_edge = |edge: usize| [&across, &down][edges.kind(edge)][edges.ends(edge)[0]];
        let weights: Vec<f32> = (0..edges.len()).map(of_edge).collect();
        Graph::new(&edges, &weights, &vec![screen; n])
    }

    fn noise(n: usize, seed: u64) -> Vec<Quad> {
        (0..n).map(|i| std::array::from_fn(|c| random(seed + c as u64, i) - 0.5)).collect()
    }

    fn apply(graph: &Graph, x: &[Quad]) -> Vec<Quad> {
        (0..x.len()).map(|i| graph.row(i, x)).collect()
    }

    fn residual(graph: &Graph, b: &[Quad], x: &[Quad]) -> Vec<Quad> {
        (0..x.len()).map(|i| graph.residual(i, b, x)).collect()
    }

    fn norm(x: &[Quad]) -> f64 {
        dot(x, x).iter().sum::<f64>().sqrt()
    }

    #[test]
    fn solutions_are_found_whatever_the_weights_and_the_size() {
        for (width, height) in [(1, 1), (1, 40), (30, 1), (17, 23), (150, 90)] {
            for decades in [0.0, 4.0, 8.0, 12.0] {
                let graph = grid(width, height, decades, 1e-3);
                let exact = noise(width * height, 5);
                let b = apply(&graph, &exact);
                let size = norm(&b);
                let solver = Multigrid::new(graph);
                let solved = solver.solve(&b, vec![[0.0; 4]; width * height], 1e-5);
                let left = norm(&residual(solver.graph(0), &b, &solved.x));
                assert!(left < 1e-3 * size, "{width}x{height}, {decades} decades: {left} of {size}");
                let most = if decades > 8.0 { 60 } else { 30 };
                assert!(solved.steps <= most, "{width}x{height}, {decades} decades: {} steps", solved.steps);
            }
        }
    }

    #[test]
    fn a_solution_is_not_worked_on() {
        let graph = grid(150, 90, 4.0, 1e-3);
        let exact = noise(150 * 90, 5);
        let b = apply(&graph, &exact);
        let solver = Multigrid::new(graph);
        let best = solver.solve(&b, exact, 1e-7).x;
        let again = solver.solve(&b, best, 1e-3);
        assert!(again.steps < 40, "{} steps", again.steps);
    }

    #[test]
    fn steps_do_not_grow_with_the_image() {
        let steps = |width: usize, height: usize| {
            let graph = grid(width, height, 4.0, 1e-4);
            let b = noise(width * height, 3);
            Multigrid::new(graph).solve(&b, vec![[0.0; 4]; width * height], 1e-4).steps
        };
        let (small, large) = (steps(64, 48), steps(512, 384));
        assert!(large <= small + small / 2 + 2, "{small} steps, then {large}");
    }

    #[test]
    fn constants_are_left_alone_without_screening() {
        let graph = grid(40, 30, 3.0, 0.0);
        let exact = noise(1200, 8);
        let b = apply(&graph, &exact);
        let x = Multigrid::new(graph).solve(&b, vec![[0.0; 4]; 1200], 1e-6).x;
        let mean = |c: usize| (0..1200).map(|i| f64::from(x[i][c] - exact[i][c])).sum::<f64>() / 1200.0;
        for c in 0..4 {
            let spread = (0..1200).map(|i| (f64::from(x[i][c] - exact[i][c]) - mean(c)).abs()).fold(0.0, f64::max);
            assert!(spread < 5e-2, "{spread}");
        }
    }

    #[test]
    fn weak_screening_decides_values_along_strong_edges() {
        // Columns of one value each, seven decades of weights: products of weights and values are far larger than what decides.
        let (width, height) = (20, 40);
        let edges = Edges::cross((width, height));
        let weights: Vec<f32> = (0..edges.len()).map(|edge| [1e-2, 1e6][edges.kind(edge)]).collect();
        let graph = Graph::new(&edges, &weights, &vec![0.1; width * height]);
        let exact: Vec<Quad> = (0..width * height).map(|i| [300.0 * random(4, i % width); 4]).collect();
        let b = apply(&graph, &exact);
        let solved = Multigrid::new(graph).solve(&b, vec![[0.0; 4]; width * height], 1e-3).x;
        for (a, b) in solved.iter().zip(&exact) {
            assert!((a[0] - b[0]).abs() < 0.01 * b[0] + 0.1, "{} instead of {}", a[0], b[0]);
        }
    }

    #[test]
    fn threads_do_not_matter() {
        let solve = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                Multigrid::new(grid(200, 150, 3.0, 0.1)).solve(&noise(30000, 2), vec![[0.0; 4]; 30000], 1e-4).x
            })
        };
        assert!(solve(1) == solve(2));
    }
}
