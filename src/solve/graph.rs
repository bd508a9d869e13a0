//! Graphs with weighted edges and a screening weight at every node: the matrices of weighted Poisson problems, at
//! full resolution and coarsened.

use rayon::prelude::*;

use crate::film::Edges;

/// Up to four right-hand sides or solutions at a node, which are solved together.
pub type Quad = [f32; 4];

/// Nodes that a thread takes at a time.
pub const CHUNK: usize = 8192;

/// Number of pairwise aggregations from one level to the next.
const ROUNDS: u32 = 3;

/// Screening, as a share of its edges' weights, of every node where there is none at all.
const LEAST_SCREEN: f32 = 1e-7;

/// Most nodes that a node of the next level stands for.
pub const MEMBERS: usize = 1 << ROUNDS;

/// Stands in place of a coarse node for a node that has none, since its own screening weight all but decides its value.
pub const ALONE: u32 = u32::MAX;

/// A symmetric matrix: on the diagonal the screening weight and the edge weights, beside it minus the edge weights.
pub struct Graph {
    /// Start of each node's entries in `edges`, and the end of the last.
    first: Vec<u32>,
    /// Other end and weight.
    edges: Vec<(u32, f32)>,
    screen: Vec<f32>,
    diagonal: Vec<f32>,
}

impl Graph {
    /// The graph of pixels and the edges between them; edges without weight are left out. A row's entries are in the
    /// order of their nodes.
    pub fn new(edges: &Edges, weights: &[f32], screen: &[f32]) -> Self {
        Self::build(screen.to_vec(), |pixel, out| {
            let first = out.len();
            let weighted = edges.around(pixel).map(|half| (half.to as u32, weights[half.edge]));
            out.extend(weighted.filter(|(_, weight)| *weight > 0.0));
            out[first..].sort_unstable_by_key(|(to, _)| *to);
        })
    }

    /// A graph from its screening weights and a function that appends a node's edges.
    fn build(screen: Vec<f32>, edges_of: impl Fn(usize, &mut Vec<(u32, f32)>) + Sync) -> Self {
        let nodes = screen.len();
        let parts: Vec<_> = (0..nodes.div_ceil(CHUNK))
            .into_par_iter()
            .map(|part| {
                let range = part * CHUNK..nodes.min((part + 1) * CHUNK);
                let (mut counts, mut edges) = (Vec::with_capacity(range.len()), Vec::new());
                for i in range {
                    let before = edges.len();
                    edges_of(i, &mut edges);
                    counts.push((edges.len() - before) as u32);
                }
                (counts, edges)
            })
            .collect();
        let mut first = Vec::with_capacity(nodes + 1);
        first.push(0);
        let mut edges = Vec::with_capacity(parts.iter().map(|(_, edges)| edges.len()).sum());
        for (counts, part) in parts {
            counts.iter().for_each(|count| first.push(first[first.len() - 1] + count));
            edges.extend_from_slice(&part);
        }
        let mut graph = Self { first, edges, diagonal: Vec::new(), screen };
        let sum = |i: usize| graph.screen[i] + graph.edges(i).iter().map(|edge| edge.1).sum::<f32>();
        graph.diagonal = (0..nodes).into_par_iter().map(sum).collect();
        // Without any screening the matrix is singular. So it is where some nodes are screened and others, which no edges
        // join to them, are not: nobody asks for that.
        if graph.screen.iter().all(|&screen| screen <= 0.0) {
            graph.screen = graph.diagonal.iter().map(|diagonal| LEAST_SCREEN * diagonal).collect();
        }
        // A node without any weight keeps its value.
        for i in (0..nodes).filter(|&i| graph.diagonal[i] <= 0.0).collect::<Vec<_>>() {
            (graph.screen[i], graph.diagonal[i]) = (1.0, 1.0);
        }
        graph
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.screen.len()
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.screen.is_empty()
    }

    /// A node's edges: other end and weight.
    #[inline(always)]
    pub fn edges(&self, node: usize) -> &[(u32, f32)] {
        &self.edges[self.first[node] as usize..self.first[node + 1] as usize]
    }

    /// Diagonal of the matrix.
    pub fn diagonal(&self) -> &[f32] {
        &self.diagonal
    }

    /// Row `node` of the matrix times `x`.
    #[inline(always)]
    pub fn row(&self, node: usize, x: &[Quad]) -> Quad {
        // Differences first: strong edges between values that are nearly the same would cancel to rounding errors, which may
        // be larger than all that a weak screening adds up to.
        let own = x[node];
        let mut sum = own.map(|own| self.screen[node] * own);
        for &(to, weight) in self.edges(node) {
            (0..4).for_each(|c| sum[c] += weight * (own[c] - x[to as usize][c]));
        }
        sum
    }

    /// Row `node` of `b` minus the matrix times `x`.
    #[inline(always)]
    pub fn residual(&self, node: usize, b: &[Quad], x: &[Quad]) -> Quad {
        let row = self.row(node, x);
        std::array::from_fn(|c| b[node][c] - row[c])
    }

    /// Joins nodes in pairs along their strongest edges. Returns the pair of every node, and the number of pairs.
    fn pairs(&self) -> (Vec<u32>, usize) {
        const UNSEEN: u32 = u32::MAX - 1;
        let mut joined = vec![UNSEEN; self.len()];
        let mut count = 0;
        for i in 0..self.len() {
            if joined[i] != UNSEEN {
                continue;
            }
            let strength: f32 = self.edges(i).iter().map(|edge| edge.1).sum();
            if self.screen[i] > 4.0 * strength {
                joined[i] = ALONE;
                continue;
            }
            let strongest = self.edges(i).iter().map(|edge| edge.1).fold(0.0, f32::max);
            let free = self.edges(i).iter().filter(|&&(to, _)| joined[to as usize] == UNSEEN);
            let partner = free.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|edge| edge.1 >= 0.25 * strongest);
            joined[i] = count;
            if let Some(&(to, _)) = partner {
                joined[to as usize] = count;
            }
            count += 1;
        }
        (joined, count as usize)
    }

    /// The graph whose nodes stand for those that `joined` sends to them (Galerkin with constant interpolation).
    fn contract(&self, joined: &[u32], count: usize) -> Self {
        let mut members = vec![[ALONE; 2]; count];
        let mut screen = vec![0.0; count];
        for (i, &to) in joined.iter().enumerate().filter(|(_, to)| **to != ALONE) {
            let slot = usize::from(members[to as usize][0] != ALONE);
            members[to as usize][slot] = i as u32;
            screen[to as usize] += self.screen[i];
            // A neighbour that is left out holds its value: it screens.
            let fixed = self.edges(i).iter().filter(|edge| joined[edge.0 as usize] == ALONE);
            screen[to as usize] += fixed.map(|edge| edge.1).sum::<f32>();
        }
        Self::build(screen, |node, edges| {
            let start = edges.len();
            for &member in members[node].iter().filter(|&&member| member != ALONE) {
                for &(to, weight) in self.edges(member as usize) {
                    let to = joined[to as usize];
                    if to == ALONE || to as usize == node {
                        continue;
                    }
                    match edges[start..].iter_mut().find(|edge| edge.0 == to) {
                        Some(edge) => edge.1 += weight,
                        None => edges.push((to, weight)),
                    }
                }
            }
        })
    }

    /// A graph of about an eighth of the nodes, and the coarse node that stands for each node here.
    pub fn coarsen(&self) -> (Self, Vec<u32>) {
        let (mut joined, count) = self.pairs();
        let mut coarse = self.contract(&joined, count);
        for _ in 1..ROUNDS {
            let (again, count) = coarse.pairs();
            coarse = coarse.contract(&again, count);
            joined.iter_mut().filter(|to| **to != ALONE).for_each(|to| *to = again[*to as usize]);
        }
        (coarse, joined)
    }
}
