//! A tree of boxes over triangles: finds the few that are near a point among millions.

use super::triangle::Triangle;
use crate::math::{Bounds, Vec3};

/// Triangles in a leaf: below this the boxes cost more than they save.
const LEAF: usize = 4;

/// Depth of the traversal stack. Halving by count makes a tree at most 31 deep for 2^32 triangles.
const STACK: usize = 64;

/// A binary tree of axis-aligned boxes over triangles, halved by count along the longest axis of their centres.
#[derive(Debug, Clone)]
pub struct TriangleTree {
    triangles: Vec<Triangle>,
    nodes: Vec<Node>,
    /// Triangle numbers, leaf by leaf.
    order: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    bounds: Bounds,
    /// First entry of `order` for a leaf, first of two children else.
    first: u32,
    /// Triangles in a leaf; 0 for an inner node.
    count: u32,
}

impl TriangleTree {
    /// A tree over triangles, which keep their numbers.
    #[must_use]
    pub fn new(triangles: Vec<Triangle>) -> Self {
        let centres: Vec<Vec3> = triangles.iter().map(|t| t.corners().iter().sum::<Vec3>() / 3.0).collect();
        let mut order: Vec<u32> = (0..u32::try_from(triangles.len()).unwrap_or(u32::MAX)).collect();
        let mut tree = Self { triangles, nodes: Vec::new(), order: Vec::new() };
        if !order.is_empty() {
            let placeholder = Node { bounds: Bounds::EMPTY, first: 0, count: 0 };
            tree.nodes.push(placeholder);
            tree.split(0, 0, &mut order, &centres);
            tree.order = order;
        }
        tree
    }

    /// The triangles, by number.
    #[must_use]
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// The box around all triangles.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.nodes.first().map_or(Bounds::EMPTY, |root| root.bounds)
    }

    /// Calls `visit` with the number of every triangle within `reach` [m] of `point`, in no particular order.
    pub fn within(&self, point: &Vec3, reach: f64, mut visit: impl FnMut(u32)) {
        let squared_reach = reach * reach;
        self.traverse(
            |bounds| squared_distance_to_box(bounds, point) <= squared_reach,
            |number, triangle| {
                if triangle.closest(point).squared_distance <= squared_reach {
                    visit(number);
                }
            },
        );
    }

    /// Squared distance [m^2] of `point` to the nearest triangle, or `limit` where that is nearer.
    #[must_use]
    pub fn squared_distance(&self, point: &Vec3, limit: f64) -> f64 {
        let Some(root) = self.nodes.first() else { return limit };
        let mut best = limit;
        let mut stack = [(0_u32, 0.0); STACK];
        let mut height = 1;
        stack[0] = (0, squared_distance_to_box(&root.bounds, point));
        while height > 0 {
            height -= 1;
            let (number, squared) = stack[height];
            if squared >= best {
                continue;
            }
            let node = self.nodes[number as usize];
            for &triangle in self.leaf(&node) {
                best = best.min(self.triangles[triangle as usize].closest(point).squared_distance);
            }
            if node.count == 0 {
                let children = [node.first, node.first + 1]
                    .map(|child| (child, squared_distance_to_box(&self.nodes[child as usize].bounds, point)));
                // the nearer child on top of the stack: it is looked at first and cuts off the other
                let nearer_first = children[0].1 <= children[1].1;
                stack[height] = children[usize::from(nearer_first)];
                stack[height + 1] = children[usize::from(!nearer_first)];
                height += 2;
            }
        }
        best
    }

    /// Visits all triangles in boxes that `enter` accepts.
    pub fn traverse(&self, enter: impl Fn(&Bounds) -> bool, mut visit: impl FnMut(u32, &Triangle)) {
        let mut stack = [0_u32; STACK];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let node = self.nodes[stack[height] as usize];
            if !enter(&node.bounds) {
                continue;
            }
            for &number in self.leaf(&node) {
                visit(number, &self.triangles[number as usize]);
            }
            if node.count == 0 {
                stack[height] = node.first + 1;
                stack[height + 1] = node.first;
                height += 2;
            }
        }
    }

    fn leaf(&self, node: &Node) -> &[u32] {
        &self.order[node.first as usize..][..node.count as usize]
    }

    /// Makes node `number` hold `order`, which begins at entry `first` of the final order.
    fn split(&mut self, number: usize, first: usize, order: &mut [u32], centres: &[Vec3]) {
        let mut bounds = Bounds::EMPTY;
        let mut spread = Bounds::EMPTY;
        for &triangle in &*order {
            bounds = bounds.union(&self.triangles[triangle as usize].bounds());
            spread.include(&centres[triangle as usize]);
        }
        // distances to triangles carry round-off of their coordinates: boxes must not be tighter than that
        let largest = bounds.minimum.iter().chain(&bounds.maximum).fold(0.0_f64, |most, x| most.max(x.abs()));
        let bounds = bounds.grown(16.0 * f64::EPSILON * largest);
        if order.len() <= LEAF {
            self.nodes[number] = Node { bounds, first: index(first), count: index(order.len()) };
            return;
        }
        let axis = spread.size().imax();
        let half = order.len() / 2;
        let key = |triangle: &u32| centres[*triangle as usize][axis];
        order.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        let children = self.nodes.len();
        self.nodes[number] = Node { bounds, first: index(children), count: 0 };
        let placeholder = Node { bounds: Bounds::EMPTY, first: 0, count: 0 };
        self.nodes.extend([placeholder; 2]);
        let (lower, upper) = order.split_at_mut(half);
        self.split(children, first, lower, centres);
        self.split(children + 1, first + half, upper, centres);
    }
}

/// Squared distance [m^2] of `point` to a box; 0 inside.
fn squared_distance_to_box(bounds: &Bounds, point: &Vec3) -> f64 {
    let mut squared = 0.0;
    for axis in 0..3 {
        let outside = (bounds.minimum[axis] - point[axis]).max(point[axis] - bounds.maximum[axis]).max(0.0);
        squared += outside * outside;
    }
    squared
}

/// A position in the tree. Triangles are numbered by `u32`, and there are fewer nodes than triangles above a leaf.
fn index(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use proptest::prelude::*;

    fn coordinates() -> impl Strategy<Value = Vec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| vec3(x, y, z))
    }

    fn soup() -> impl Strategy<Value = Vec<Triangle>> {
        let triangle = (coordinates(), coordinates(), coordinates(), 0.05..1.0)
            .prop_map(|(at, b, c, size)| Triangle::new([at, at + b * size, at + c * size]));
        prop::collection::vec(triangle, 0..200)
    }

    proptest! {
        #[test]
        fn finds_what_brute_force_finds(triangles in soup(), point in coordinates(), reach in 0.0..1.5_f64) {
            let expected: Vec<u32> = (0_u32..)
                .zip(&triangles)
                .filter(|(_, t)| t.closest(&point).squared_distance <= reach * reach)
                .map(|(number, _)| number)
                .collect();
            let nearest = triangles.iter().map(|t| t.closest(&point).squared_distance).fold(f64::INFINITY, f64::min);
            let tree = TriangleTree::new(triangles);
            let mut found = Vec::new();
            tree.within(&point, reach, |number| found.push(number));
            found.sort_unstable();
            prop_assert_eq!(found, expected);
            prop_assert_eq!(tree.squared_distance(&point, f64::INFINITY), nearest);
            prop_assert_eq!(tree.squared_distance(&point, nearest / 2.0), nearest / 2.0);
        }
    }

    #[test]
    fn equal_centres_do_not_recurse_for_ever() {
        let triangle = Triangle::new([vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)]);
        let tree = TriangleTree::new(vec![triangle; 1000]);
        let mut found = 0;
        tree.within(&vec3(0.2, 0.2, 0.5), 0.6, |_| found += 1);
        assert_eq!(found, 1000);
    }
}
