/* Neighbour search against brute force, in 1, 2 and 3 dimensions, open and periodic. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* an allocator that counts its blocks and can be told to fail from the k-th request on */
static int blocks_alive, refused, fail_after = -1;

static int allocation_fails(void) {
    int fails = 0;
#ifdef _OPENMP
#pragma omp critical(test_tree_alloc)
#endif
    if (fail_after >= 0) fails = fail_after-- == 0;
    if (fails) {
        fail_after = 0;
        refused = 1;
    }
    return fails;
}

static void count_block(int step) {
#ifdef _OPENMP
#pragma omp atomic
#endif
    blocks_alive += step;
}

static void *counting_realloc(void *block, size_t bytes) {
    if (allocation_fails()) return NULL;
    void *grown = realloc(block, bytes);
    if (block == NULL && grown != NULL) count_block(1);
    return grown;
}

static void counting_free(void *block) {
    if (block != NULL) count_block(-1);
    free(block);
}

#define SPHPA_MALLOC(bytes) counting_realloc(NULL, bytes)
#define SPHPA_REALLOC(block, bytes) counting_realloc(block, bytes)
#define SPHPA_FREE(block) counting_free(block)
#define SPHPA_TREE_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

/* ---- particles ------------------------------------------------------------------------------- */

enum { UNIFORM, LATTICE, CLUSTERED, CLUMP, COLLINEAR, COINCIDENT, VARYING, KINDS };
static const char *const kind_name[KINDS] = {"uniform",   "lattice",    "clustered", "clump",
                                             "collinear", "coincident", "varying"};

typedef struct cloud {
    int dim;
    size_t n;
    double *x, *support;
    sphpa_box box;
    int wraps; /* 0: open, whatever the box */
} cloud;

static const sphpa_box *periodic(const cloud *c) { return c->wraps ? &c->box : NULL; }

static cloud cloud_alloc(int dim, size_t n) {
    cloud c;
    memset(&c, 0, sizeof c);
    c.dim = dim;
    c.n = n;
    c.x = (double *)calloc(3 * n, sizeof(double));
    c.support = (double *)calloc(n, sizeof(double));
    assert_non_null(c.x);
    assert_non_null(c.support);
    return c;
}

static void cloud_free(cloud *c) {
    free(c->x);
    free(c->support);
    memset(c, 0, sizeof *c);
}

/* point i in the unit cube and its support, the spacing at unit density being d */
static double kind_point(int kind, int dim, size_t i, double d, double *x, sphpa_rng *rng) {
    double t = sphpa_rng_uniform(rng), s = 2.3 * d;
    size_t row = (size_t)(1.0 / d + 0.5);
    for (int a = 0; a < 3; a++) x[a] = a < dim ? sphpa_rng_uniform(rng) : 0.0;
    if (kind == LATTICE) {
        size_t cell[3] = {i % row, i / row % row, i / (row * row)};
        for (int a = 0; a < dim; a++) x[a] = ((double)(cell[a] % row) + 0.5) / (double)row;
        s = 2.0 / (double)row; /* neighbours exactly at the support: row is a power of two */
    }
    /* half of them in a cube smaller by f: in 3-D a density contrast of 1e6 (f = 0.01) */
    double f = kind == CLUSTERED ? pow(1e-6, 1.0 / dim) : kind == CLUMP ? 1e-9 : 1.0;
    if ((kind == CLUSTERED || kind == CLUMP) && i % 2 == 0) {
        for (int a = 0; a < dim; a++) x[a] = 0.31 + f * x[a];
        s *= f;
    }
    if (kind == COLLINEAR) {
        for (int a = 0; a < dim; a++) x[a] = 0.1 + 0.8 * t;
        s = 0.02;
    }
    if (kind == COINCIDENT && i % 3 != 0)
        for (int a = 0; a < dim; a++) x[a] = (double)(i % 7) / 8.0; /* corners 0 included */
    if (kind == VARYING) s = 0.003 * pow(100.0, t);
    return kind == LATTICE ? s : s * (0.9 + 0.1 * t); /* no two alike */
}

/* n particles in a box of unequal sides; axes in the mask wrap */
static cloud cloud_make(int kind, int dim, size_t n, int mask, double scale, double offset,
                        uint64_t seed) {
    static const double side[3] = {1.0, 0.75, 1.5};
    cloud c = cloud_alloc(dim, n);
    sphpa_rng rng = sphpa_rng_seed(seed, 5);
    double d = 1.0 / (dim == 1 ? 256.0 : dim == 2 ? 16.0 : 8.0);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        c.support[i] = scale * kind_point(kind, dim, i, d, x, &rng);
        for (int a = 0; a < 3; a++) {
            double length = kind == LATTICE ? 1.0 : side[a];
            c.x[3 * i + (size_t)a] = a < dim ? scale * (offset + length * x[a]) : 0.0;
            c.box.low[a] = scale * offset;
            c.box.high[a] = scale * (offset + length);
            c.box.periodic[a] = (mask >> a) & 1;
            if (c.box.periodic[a] && a < dim)
                c.support[i] = sphpa_min_(c.support[i], 0.4 * scale * length);
        }
    }
    c.wraps = mask != 0;
    return c;
}

/* ---- brute force ----------------------------------------------------------------------------- */

static double brute_dx(const cloud *c, int a, double dx) {
    if (!c->wraps || c->box.periodic[a] == 0) return dx;
    double length = c->box.high[a] - c->box.low[a];
    return dx - length * rint(dx / length);
}

static double brute_r2(const cloud *c, const double *p, const double *q) {
    double sum = 0.0;
    for (int a = 0; a < c->dim; a++) {
        double dx = brute_dx(c, a, p[a] - q[a]);
        sum += dx * dx;
    }
    return sum;
}

static int brute_pair(const cloud *c, size_t i, size_t j, double skin) {
    double s = (1.0 + skin) * fmax(c->support[i], c->support[j]);
    return i != j && brute_r2(c, c->x + 3 * i, c->x + 3 * j) < s * s;
}

static void build(sphpa_tree *tree, const cloud *c) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    if (sphpa_tree_build(tree, c->dim, c->n, c->x, c->support, periodic(c), &err) != SPHPA_OK)
        fail_msg("%s", err.message);
}

/* whether that image of sorted particle j is near one of the group's, by another order of sums */
static int brute_near(const cloud *c, const sphpa_tree *tree, size_t first, size_t last, size_t j,
                      uint32_t image, double skin) {
    const double *q = c->x + 3 * (size_t)tree->order[j];
    int digit[3] = {(int)(image % 3), (int)(image / 3 % 3), (int)(image / 9)};
    for (int a = 0; a < 3; a++)
        if (digit[a] != 0 && (a >= c->dim || !c->wraps || c->box.periodic[a] == 0)) return 0;
    for (size_t k = first; k < last; k++) {
        const double *p = c->x + 3 * (size_t)tree->order[k];
        double sum = 0.0;
        for (int a = 0; a < c->dim; a++) {
            double length = c->box.high[a] - c->box.low[a], dx = q[a] - p[a];
            dx += digit[a] == 1 ? length : digit[a] == 2 ? -length : 0.0;
            sum += dx * dx;
        }
        double s = (1.0 + skin) * fmax(c->support[tree->order[k]], c->support[tree->order[j]]);
        if (sum < s * s) return 1;
    }
    return 0;
}

/* lists of groups, element for element and in order: image by image, then as sorted */
static void check_groups(const cloud *c, const sphpa_tree *tree, double skin, size_t group,
                         sphpa_tree_lists *lists) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    if (sphpa_tree_lists_build(tree, skin, group, lists, &err) != SPHPA_OK)
        fail_msg("%s", err.message);
    size_t entries = 0;
    assert_int_equal(lists->group, group);
    assert_int_equal(lists->groups, (tree->active + group - 1) / group);
    for (size_t g = 0; g < lists->groups; g++) {
        size_t length = 0, found = 0, first = g * group;
        size_t last = first + group < tree->active ? first + group : tree->active;
        uint32_t same = 0;
        const uint32_t *list = sphpa_tree_list_of(lists, g, &length);
        assert_ptr_equal(list, sphpa_tree_list_of_(lists, g, &same));
        assert_int_equal(length, same);
        for (uint32_t image = 0; image < SPHPA_TREE_IMAGES; image++)
            for (size_t j = 0; j < c->n && (image == 0 || c->wraps); j++)
                if (brute_near(c, tree, first, last, j, image, skin)) {
                    assert_true(found < length);
                    assert_int_equal(SPHPA_TREE_ENTRY_INDEX(list[found]), j);
                    assert_int_equal(SPHPA_TREE_ENTRY_IMAGE(list[found]), image);
                    found++;
                }
        assert_int_equal(found, length);
        entries += found;
    }
    assert_int_equal(entries, lists->entries);
}

/* lists of one particle: everyone of (3) once, itself too, nobody else; returns the pairs */
static size_t check_lists(const cloud *c, const sphpa_tree *tree, double skin,
                          sphpa_tree_lists *lists) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    if (sphpa_tree_lists_build(tree, skin, 1, lists, &err) != SPHPA_OK) fail_msg("%s", err.message);
    assert_int_equal(lists->n, c->n);
    unsigned char *seen = (unsigned char *)calloc(c->n, 1);
    assert_non_null(seen);
    size_t pairs = 0;
    for (size_t k = 0; k < c->n; k++) {
        size_t length = 0, found = 1;
        const uint32_t *list = sphpa_tree_list_of(lists, k, &length);
        for (size_t m = 0; m < length; m++) seen[SPHPA_TREE_ENTRY_INDEX(list[m])]++;
        assert_int_equal(seen[k], 1);
        for (size_t j = 0; j < c->n; j++)
            if (brute_pair(c, tree->order[k], tree->order[j], skin)) {
                assert_int_equal(seen[j], 1);
                found++;
            }
        assert_int_equal(found, length);
        for (size_t m = 0; m < length; m++) seen[SPHPA_TREE_ENTRY_INDEX(list[m])] = 0;
        pairs += found - 1;
    }
    free(seen);
    assert_int_equal(pairs + c->n, lists->entries);
    return pairs;
}

/* a list of caller's indices against a predicate already evaluated: every one once, no other */
static void check_set(const sphpa_tree_list *list, unsigned char *expected, size_t n) {
    size_t wanted = 0;
    for (size_t j = 0; j < n; j++) wanted += expected[j];
    assert_int_equal(list->count, wanted);
    for (size_t m = 0; m < list->count; m++) {
        assert_true(list->index[m] < n);
        assert_int_equal(expected[list->index[m]], 1);
        expected[list->index[m]] = 0;
    }
}

static void check_single(const cloud *c, const sphpa_tree *tree) {
    sphpa_tree_list list;
    memset(&list, 0, sizeof list);
    unsigned char *expected = (unsigned char *)calloc(c->n, 1);
    assert_non_null(expected);
    for (size_t i = 0; i < c->n; i++) {
        for (size_t j = 0; j < c->n; j++)
            expected[j] = (unsigned char)brute_pair(c, i, j, 0.0);
        assert_int_equal(sphpa_tree_neighbours(tree, i, &list), SPHPA_OK);
        check_set(&list, expected, c->n);
    }
    free(expected);
    sphpa_tree_list_free(&list);
}

/* order a permutation, rank its inverse, nodes a partition with tight boxes, leaves in order */
static void check_shape(const cloud *c, const sphpa_tree *tree, int coincident) {
    unsigned char *seen = (unsigned char *)calloc(c->n, 1);
    assert_non_null(seen);
    for (size_t k = 0; k < c->n; k++) {
        size_t i = tree->order[k];
        assert_true(i < c->n && !seen[i]);
        seen[i] = 1;
        assert_int_equal(tree->rank[i], k);
        for (int a = 0; a < 3; a++)
            assert_true(tree->pos[4 * k + (size_t)a] ==
                        (a < c->dim ? c->x[3 * i + (size_t)a] : 0.0));
        assert_true(tree->pos[4 * k + 3] == c->support[i]);
    }
    free(seen);
    size_t leaves = 0, next = 0;
    for (size_t t = 0; t < tree->node_count; t++) {
        const sphpa_tree_node *node = tree->nodes + t;
        double low[3] = {1e300, 1e300, 1e300}, high[3] = {-1e300, -1e300, -1e300}, largest = 0.0;
        for (size_t k = node->first; k < node->first + node->count; k++) {
            for (size_t a = 0; a < 3; a++) {
                low[a] = fmin(low[a], tree->pos[4 * k + a]);
                high[a] = fmax(high[a], tree->pos[4 * k + a]);
            }
            largest = fmax(largest, tree->pos[4 * k + 3]);
        }
        for (int a = 0; a < 3; a++)
            assert_true(node->low[a] == low[a] && node->high[a] == high[a]);
        assert_true(node->support == largest);
        if (node->children == 0) {
            leaves++;
            int one_point = low[0] == high[0] && low[1] == high[1] && low[2] == high[2];
            size_t most = tree->leaf_size > 0 ? (size_t)tree->leaf_size : 32;
            assert_true(node->count <= most || (coincident && one_point));
            continue;
        }
        assert_true(node->child > t && node->children >= 2 && node->children <= 8);
        uint32_t at = node->first;
        for (uint32_t b = node->child; b < node->child + node->children; b++) {
            assert_true(tree->nodes[b].count > 0 && tree->nodes[b].first == at);
            at += tree->nodes[b].count;
        }
        assert_int_equal(at, node->first + node->count);
    }
    assert_int_equal(leaves, tree->leaf_count);
    for (size_t l = 0; l < tree->leaf_count; l++) {
        assert_int_equal(tree->nodes[tree->leaves[l]].first, next);
        next += tree->nodes[tree->leaves[l]].count;
    }
    assert_int_equal(next, c->n);
}

/* ---- neighbours ------------------------------------------------------------------------------ */

/* some are sorted behind the others, each kind in its order; lists are of these only, and of all */
static void test_behind(void **state) {
    (void)state;
    for (int kind = 0; kind < KINDS; kind++)
        for (int dim = 1; dim <= 3; dim++)
            for (int way = 0; way < 4; way++) { /* every third, none, all, one side */
                cloud c = cloud_make(kind, dim, 300, way % 2 ? 7 : 0, 1.0, -0.4, 3);
                int32_t behind[300];
                sphpa_tree plain, tree;
                sphpa_tree_lists lists;
                size_t active = 0, next[2] = {0, 0};
                memset(&plain, 0, sizeof plain);
                memset(&tree, 0, sizeof tree);
                memset(&lists, 0, sizeof lists);
                for (size_t i = 0; i < c.n; i++) {
                    bool side = c.x[3 * i] > 0.0;
                    behind[i] = way == 0 ? i % 3 == 0 : way == 1 ? 0 : way == 2 ? -7 : side;
                    active += behind[i] == 0 ? 1u : 0u;
                }
                build(&plain, &c);
                tree.behind = behind;
                build(&tree, &c);
                assert_int_equal(tree.active, active);
                assert_int_equal(plain.active, c.n);
                check_shape(&c, &tree, kind == COINCIDENT);
                check_single(&c, &tree);
                check_groups(&c, &tree, 0.1, 8, &lists);
                assert_int_equal(lists.n, active);
                next[1] = active;
                for (size_t k = 0; k < c.n && kind != CLUMP && kind != COINCIDENT; k++)
                    assert_int_equal(tree.order[next[behind[plain.order[k]] != 0]++], plain.order[k]);
                sphpa_tree_lists_free(&lists);
                sphpa_tree_free(&tree);
                sphpa_tree_free(&plain);
                cloud_free(&c);
            }
}

static void sweep(int dim) {
    static const double scale[3] = {1.0 / 1073741824.0, 1.0, 1073741824.0}; /* 2^-30, 1, 2^30 */
    static const int leaf[3] = {0, 1, 7};
    sphpa_tree tree;
    sphpa_tree_lists lists;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    int round = 0;
    for (int kind = 0; kind < KINDS; kind++)
        for (int mask = 0; mask < (1 << dim); mask++)
            for (int s = 0; s < 3; s += SMALL ? 2 : 1, round++) {
                size_t n = kind != LATTICE ? 200 + (size_t)(round % 5) * 31 : dim == 3 ? 512 : 256;
                double offset = round % 4 == 3 ? 1024.0 : round % 2 ? -0.5 : 0.0;
                cloud c = cloud_make(kind, dim, n, mask, scale[s], offset, (uint64_t)round);
                tree.leaf_size = leaf[round % 3];
                build(&tree, &c);
                check_shape(&c, &tree, kind == COINCIDENT || (kind == CLUMP && offset > 1.0));
                size_t pairs = check_lists(&c, &tree, 0.0, &lists);
                size_t more = check_lists(&c, &tree, 0.2, &lists);
                check_groups(&c, &tree, 0.1, (size_t)1 << (round % 5), &lists);
                if (pairs == 0 || more < pairs) fail_msg("%s: %zu pairs", kind_name[kind], pairs);
                check_single(&c, &tree);
                cloud_free(&c);
            }
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
}

static void test_sweep_1d(void **state) {
    (void)state;
    sweep(1);
}
static void test_sweep_2d(void **state) {
    (void)state;
    sweep(2);
}
static void test_sweep_3d(void **state) {
    (void)state;
    sweep(3);
}

/* several chunks, and a last one that is not full */
static void test_many(void **state) {
    (void)state;
    for (int mask = SMALL ? 7 : 0; mask < 8; mask += 7) {
        const size_t n = SMALL ? 1500 : 3333;
        cloud c = cloud_make(UNIFORM, 3, n, mask, 1.0, 0.0, 77);
        sphpa_tree tree;
        sphpa_tree_lists lists;
        memset(&tree, 0, sizeof tree);
        memset(&lists, 0, sizeof lists);
        build(&tree, &c);
        check_shape(&c, &tree, 0);
        check_lists(&c, &tree, 0.1, &lists);
        check_groups(&c, &tree, 0.1, 8, &lists);
        assert_int_equal(lists.chunk_count, (n + SPHPA_TREE_CHUNK - 1) / SPHPA_TREE_CHUNK);
        sphpa_tree_free(&tree);
        sphpa_tree_lists_free(&lists);
        cloud_free(&c);
    }
}

/* inner particles of a cubic lattice with support 2.5: all (a,b,c) != 0 with a^2+b^2+c^2 < 6.25 */
static void test_lattice_count(void **state) {
    (void)state;
    size_t inside = 0;
    for (int a = -3; a <= 3; a++)
        for (int b = -3; b <= 3; b++)
            for (int d = -3; d <= 3; d++) inside += a * a + b * b + d * d <= 6 ? 1u : 0u;
    assert_int_equal(inside, 81);
    cloud c = cloud_alloc(3, 1000);
    for (size_t i = 0; i < c.n; i++) {
        c.x[3 * i] = (double)(i % 10) + 0.5;
        c.x[3 * i + 1] = (double)(i / 10 % 10) + 0.5;
        c.x[3 * i + 2] = (double)(i / 100) + 0.5;
        c.support[i] = 2.5;
    }
    for (int a = 0; a < 3; a++) {
        c.box.high[a] = 10.0;
        c.box.periodic[a] = 1;
    }
    c.wraps = 1;
    sphpa_tree tree;
    sphpa_tree_lists lists;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    build(&tree, &c);
    assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_OK);
    for (size_t k = 0; k < c.n; k++) {
        size_t count;
        (void)sphpa_tree_list_of(&lists, k, &count);
        assert_int_equal(count, 81);
    }
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
    cloud_free(&c);
}

/* r < s is strict, and the larger support of the two decides */
static void test_boundary(void **state) {
    (void)state;
    sphpa_tree tree;
    sphpa_tree_lists lists;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    double x[6] = {1.0, 2.0, 3.0, 4.0, 6.0, 3.0}, support[2] = {0.125, 5.0}; /* r = 5 exactly */
    for (int turn = 0; turn < 2; turn++) {
        support[turn] = 0.125;
        support[1 - turn] = 5.0;
        assert_int_equal(sphpa_tree_build(&tree, 3, 2, x, support, NULL, NULL), SPHPA_OK);
        assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_OK);
        assert_int_equal(lists.entries, 2);
        support[1 - turn] = 5.0 * (1.0 + DBL_EPSILON);
        assert_int_equal(sphpa_tree_build(&tree, 3, 2, x, support, NULL, NULL), SPHPA_OK);
        assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_OK);
        assert_int_equal(lists.entries, 4);
    }
    support[0] = support[1] = 4.0; /* 1.25 * 4 = 5: strict with a skin too */
    assert_int_equal(sphpa_tree_build(&tree, 3, 2, x, support, NULL, NULL), SPHPA_OK);
    assert_int_equal(sphpa_tree_lists_build(&tree, 0.25, 1, &lists, NULL), SPHPA_OK);
    assert_int_equal(lists.entries, 2);
    assert_int_equal(sphpa_tree_lists_build(&tree, 0.2500001, 1, &lists, NULL), SPHPA_OK);
    assert_int_equal(lists.entries, 4);
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
}

static void test_one_and_many_coincident(void **state) {
    (void)state;
    sphpa_tree tree;
    sphpa_tree_lists lists;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    cloud c = cloud_alloc(3, 1000);
    for (size_t i = 0; i < c.n; i++) {
        c.x[3 * i] = 7.0;
        c.x[3 * i + 1] = -3e9;
        c.x[3 * i + 2] = 1e-9;
        c.support[i] = 1e-12;
    }
    build(&tree, &c);
    for (size_t k = 0; k < c.n; k++) assert_int_equal(tree.order[k], k); /* ties: caller's order */
    assert_int_equal(check_lists(&c, &tree, 0.0, &lists), 999 * 1000);
    c.n = 30; /* few are sorted in another way */
    build(&tree, &c);
    for (size_t k = 0; k < c.n; k++) assert_int_equal(tree.order[k], k);
    c.n = 1;
    build(&tree, &c);
    assert_int_equal(check_lists(&c, &tree, 0.0, &lists), 0);
    check_single(&c, &tree);
    assert_int_equal(sphpa_tree_coincident(&tree, NULL, NULL), SPHPA_OK);
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
    cloud_free(&c);
}

/* columns beyond dim may hold anything */
static void test_ignored_columns(void **state) {
    (void)state;
    sphpa_tree tree;
    sphpa_tree_lists lists;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    for (int dim = 1; dim <= 2; dim++) {
        cloud c = cloud_make(UNIFORM, dim, 256, 0, 1.0, 0.0, 3);
        c.box.periodic[2] = 1; /* nor does a wrapping axis beyond dim matter */
        c.box.low[2] = c.box.high[2] = 0.0;
        c.wraps = 1;
        for (size_t i = 0; i < c.n; i++)
            for (size_t a = (size_t)dim; a < 3; a++)
                c.x[3 * i + a] = i % 2 ? (double)NAN : 1e9 * (double)i;
        build(&tree, &c);
        check_shape(&c, &tree, 0);
        assert_true(check_lists(&c, &tree, 0.0, &lists) > 256);
        cloud_free(&c);
    }
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
}

static void test_query(void **state) {
    (void)state;
    sphpa_rng rng = sphpa_rng_seed(8, 8);
    sphpa_tree tree;
    sphpa_tree_list list;
    memset(&tree, 0, sizeof tree);
    memset(&list, 0, sizeof list);
    unsigned char expected[300];
    for (int dim = 1; dim <= 3; dim++)
        for (int mask = 0; mask < (1 << dim); mask++) {
            cloud c = cloud_make(CLUSTERED, dim, 300, mask, 1.0, 0.0, (uint64_t)mask);
            build(&tree, &c);
            for (int q = 0; q < 40; q++) {
                double x[3], radius = 0.3 * pow(10.0, -3.0 * sphpa_rng_uniform(&rng));
                for (int a = 0; a < 3; a++) x[a] = 0.75 * sphpa_rng_uniform(&rng);
                if (q % 2) /* at a particle: it is found, too */
                    for (int a = 0; a < 3; a++) x[a] = c.x[3 * q + a];
                for (size_t j = 0; j < c.n; j++)
                    expected[j] = brute_r2(&c, x, c.x + 3 * j) < radius * radius;
                assert_int_equal(sphpa_tree_query(&tree, x, radius, &list), SPHPA_OK);
                check_set(&list, expected, c.n);
            }
            cloud_free(&c);
        }
    sphpa_tree_free(&tree);
    sphpa_tree_list_free(&list);
}

/* ---- the order ------------------------------------------------------------------------------- */

/* A Hilbert curve goes from cell to cell through a common face, and through all cells of a cube
   before it leaves it: nothing else is asked of it here. The lattice of side^dim points fills the
   box of the keys (deep = 0), or lies in a far corner of it, where only the last bits differ. */
static void check_curve(int dim, size_t side, int deep) {
    size_t n = 1;
    for (int a = 0; a < dim; a++) n *= side;
    cloud c = cloud_alloc(dim, n + 1);
    int bits = dim == 1 ? 30 : dim == 2 ? 31 : 21;
    double d = deep ? ldexp(1.0, -bits) : 1.0 / (double)side;
    for (size_t i = 0; i <= n; i++) {
        size_t at = i;
        for (int a = 0; a < dim; a++, at /= side)
            c.x[3 * i + (size_t)a] =
                i == n ? 0.0 : (deep ? 0.75 : 0.0) + d * ((double)(at % side) + 0.5);
        c.support[i] = 0.25 * d;
    }
    for (int a = 0; a < dim; a++) c.box.high[a] = c.box.periodic[a] = 1;
    c.wraps = 1;
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    build(&tree, &c);
    double low[3] = {0.0, 0.0, 0.0}, high[3] = {0.0, 0.0, 0.0}, last[3] = {0.0, 0.0, 0.0};
    size_t seen = 0, cube = (size_t)1 << dim;
    for (size_t k = 0; k <= n; k++) {
        if (tree.order[k] == n) continue; /* the one at the origin, which is no cell of its own */
        const double *x = tree.pos + 4 * k;
        double step = 0.0;
        for (int a = 0; a < dim; a++) {
            step += fabs(x[a] - last[a]) / d;
            low[a] = seen % cube == 0 ? x[a] : fmin(low[a], x[a]);
            high[a] = seen % cube == 0 ? x[a] : fmax(high[a], x[a]);
            last[a] = x[a];
        }
        if (seen > 0) assert_near(step, 1.0, 1e-3);
        if (++seen % cube == 0)
            for (int a = 0; a < dim; a++) assert_near(high[a] - low[a], d, 1e-3);
    }
    assert_int_equal(seen, n);
    sphpa_tree_free(&tree);
    cloud_free(&c);
}

static void test_order_is_a_hilbert_curve(void **state) {
    (void)state;
    static const size_t side[3] = {4096, 64, 16};
    for (int dim = 1; dim <= 3; dim++)
        for (int deep = 0; deep < 2; deep++) check_curve(dim, side[dim - 1], deep);
}

/* a dense clump in a huge box: its keys are all equal at first, its leaves must not be */
static void test_clump_leaves(void **state) {
    (void)state;
    cloud c = cloud_make(CLUMP, 3, 4000, 0, 1.0, 0.0, 9);
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    build(&tree, &c);
    check_shape(&c, &tree, 0);
    for (size_t l = 0; l < tree.leaf_count; l++)
        assert_true(tree.nodes[tree.leaves[l]].count <= 32);
    cloud_free(&c);
    c = cloud_make(UNIFORM, 3, 2000, 0, 1.0, 0.0, 9);
    build(&tree, &c);
    assert_true(tree.leaf_count < 2000 / 13); /* well filled: cells of an octree would hold 8 */
    sphpa_tree_free(&tree);
    cloud_free(&c);
}

static uint64_t hash_lists(const sphpa_tree_lists *lists) { /* FNV-1a */
    uint64_t h = 14695981039346656037u;
    for (size_t k = 0; k < lists->groups; k++) {
        size_t count;
        const uint32_t *list = sphpa_tree_list_of(lists, k, &count);
        for (size_t m = 0; m < count; m++) h = (h ^ list[m]) * 1099511628211u;
        h = (h ^ count) * 1099511628211u;
    }
    return h;
}

static void test_threads(void **state) {
    (void)state;
#ifdef _OPENMP
    cloud c = cloud_make(VARYING, 3, 6000, 5, 1.0, 0.0, 31);
    uint64_t first_hash = 0;
    int before = omp_get_max_threads();
    for (int threads = 1; threads <= 4; threads *= 2) {
        sphpa_tree tree;
        sphpa_tree_lists lists;
        memset(&tree, 0, sizeof tree);
        memset(&lists, 0, sizeof lists);
        omp_set_num_threads(threads);
        build(&tree, &c);
        assert_int_equal(sphpa_tree_lists_build(&tree, 0.1, 8, &lists, NULL), SPHPA_OK);
        assert_true(lists.entries > 6000);
        if (threads == 1) first_hash = hash_lists(&lists);
        assert_true(hash_lists(&lists) == first_hash);
        sphpa_tree_free(&tree);
        sphpa_tree_lists_free(&lists);
    }
    omp_set_num_threads(before);
    cloud_free(&c);
#else
    (void)hash_lists;
    skip();
#endif
}

/* fewer, more, other dimension, same structs: as good as new ones */
static void test_reuse(void **state) {
    (void)state;
    static const size_t size[6] = {700, 40, 1300, 1, 1299, 700};
    sphpa_tree tree, fresh;
    sphpa_tree_lists lists, fresh_lists;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    size_t bytes = 0;
    for (int r = 0; r < 6; r++) {
        cloud c = cloud_make(UNIFORM, 1 + r % 3, size[r], r % 2, 1.0, 0.0, (uint64_t)r);
        memset(&fresh, 0, sizeof fresh);
        memset(&fresh_lists, 0, sizeof fresh_lists);
        build(&tree, &c);
        build(&fresh, &c);
        check_lists(&c, &tree, 0.0, &lists);
        assert_int_equal(sphpa_tree_lists_build(&fresh, 0.0, 1, &fresh_lists, NULL), SPHPA_OK);
        assert_true(hash_lists(&lists) == hash_lists(&fresh_lists));
        assert_int_equal(tree.node_count, fresh.node_count);
        assert_true(sphpa_tree_bytes(&tree) >= bytes);
        bytes = sphpa_tree_bytes(&tree);
        sphpa_tree_free(&fresh);
        sphpa_tree_lists_free(&fresh_lists);
        cloud_free(&c);
    }
    assert_true(bytes >= 1300 * (32 + 4 + 4));
    assert_true(sphpa_tree_lists_bytes(&lists) >= lists.entries * sizeof(uint32_t));
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
    assert_int_equal(sphpa_tree_bytes(&tree), 0);
    assert_int_equal(sphpa_tree_lists_bytes(&lists), 0);
}

/* ---- nearest images -------------------------------------------------------------------------- */

static void test_dx(void **state) {
    (void)state;
    sphpa_box box = {{-1.0, 0.0, 3.0}, {2.0, 0.5, 3.7}, {1, 0, 1}};
    sphpa_rng rng = sphpa_rng_seed(4, 4);
    for (int a = 0; a < 3; a++)
        for (int t = 0; t < 1000; t++) {
            double length = box.high[a] - box.low[a];
            double dx = 2.8 * length * (sphpa_rng_uniform(&rng) - 0.5);
            double image = sphpa_tree_dx_(&box, a, dx);
            double exact = a == 1 ? dx : dx - length * rint(dx / length);
            assert_true(image == exact);
            assert_true(sphpa_tree_dx_(&box, a, -dx) == -image);
        }
    /* half a box away stays, to either side */
    assert_true(sphpa_tree_dx_(&box, 0, 1.5) == 1.5);
    assert_true(sphpa_tree_dx_(&box, 0, -1.5) == -1.5);
    assert_true(sphpa_tree_dx_(&box, 0, 3.0) == 0.0);
}

static void test_coincident(void **state) {
    (void)state;
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    cloud c = cloud_make(UNIFORM, 3, 500, 0, 1.0, 0.0, 5);
    size_t i = 77, j = 78;
    c.x[0] = 0.0; /* squares of these distances underflow; they are not coincident */
    c.x[1] = c.x[4] = c.x[7] = c.x[2] = c.x[5] = c.x[8] = 0.5;
    c.x[3] = 1e-200;
    c.x[6] = 1.0;
    build(&tree, &c);
    assert_int_equal(sphpa_tree_coincident(&tree, &i, &j), SPHPA_OK);
    assert_true(i == 77 && j == 78);
    for (int a = 0; a < 3; a++) c.x[3 * 400 + a] = c.x[3 * 123 + a];
    build(&tree, &c);
    assert_int_equal(sphpa_tree_coincident(&tree, &i, &j), SPHPA_ERROR_COINCIDENT);
    assert_true(i == 123 && j == 400);
    c.x[3 * 400] += 1e-9;
    c.box.periodic[0] = 1; /* the two faces of the box are one: 0 and 1 */
    c.wraps = 1;
    build(&tree, &c);
    assert_int_equal(sphpa_tree_coincident(&tree, &i, &j), SPHPA_ERROR_COINCIDENT);
    assert_true(i == 0 && j == 2);
    sphpa_tree_free(&tree);
    assert_int_equal(sphpa_tree_coincident(&tree, &i, &j), SPHPA_ERROR_EMPTY);
    cloud_free(&c);
}

/* ---- friends of friends ---------------------------------------------------------------------- */

/* flood fill over all pairs, then number the groups by selection */
static size_t brute_friends(const cloud *c, const double *link, const unsigned char *mask,
                            int32_t *labels) {
    size_t n = c->n, found = 0, given = 0;
    size_t *raw = (size_t *)calloc(n, sizeof *raw), *stack = (size_t *)calloc(n, sizeof *stack);
    size_t *count = (size_t *)calloc(n + 1, sizeof *count);
    assert_true(raw != NULL && stack != NULL && count != NULL);
    for (size_t i = 0; i < n; i++) {
        labels[i] = -1;
        if (raw[i] != 0 || (mask && !mask[i])) continue;
        size_t top = 0;
        stack[top++] = i;
        raw[i] = ++found; /* groups appear by smallest index */
        while (top > 0) {
            size_t a = stack[--top];
            count[raw[i]]++;
            for (size_t b = 0; b < n; b++) {
                double reach = 0.5 * (link[a] + link[b]);
                if (raw[b] != 0 || (mask && !mask[b])) continue;
                if (!(brute_r2(c, c->x + 3 * a, c->x + 3 * b) < reach * reach)) continue;
                raw[b] = raw[i];
                stack[top++] = b;
            }
        }
    }
    for (; given < found; given++) {
        size_t best = 0;
        for (size_t g = 1; g <= found; g++)
            if (count[g] > count[best]) best = g;
        for (size_t i = 0; i < n; i++)
            if (raw[i] == best) labels[i] = (int32_t)given;
        count[best] = 0;
    }
    free(raw);
    free(stack);
    free(count);
    return found;
}

static void test_friends(void **state) {
    (void)state;
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    sphpa_rng rng = sphpa_rng_seed(6, 6);
    int several = 0, round = 0;
    for (int dim = 1; dim <= 3; dim++)
        for (int kind = 0; kind < KINDS; kind++)
            for (int box = 0; box < 2; box++)
                for (int masked = 0; masked < 2; masked++, round++) {
                    size_t n = kind == LATTICE && dim == 3 ? 512 : 256, groups = 0;
                    cloud c = cloud_make(kind, dim, n, box ? 3 : 0, 1.0, 0.0, (uint64_t)round);
                    double link[512];
                    unsigned char mask[512];
                    int32_t labels[512], expected[512];
                    for (size_t i = 0; i < n; i++) {
                        link[i] = c.support[i] * (0.1 + 0.5 * sphpa_rng_uniform(&rng));
                        if (kind == LATTICE) link[i] = 0.5 * c.support[i]; /* exactly the spacing */
                        mask[i] = sphpa_rng_below(&rng, 4) != 0;
                        if (masked && !mask[i]) link[i] = (double)NAN; /* must not be read */
                    }
                    tree.leaf_size = round % 3;
                    build(&tree, &c);
                    assert_int_equal(sphpa_tree_friends(&tree, link, masked ? mask : NULL, labels,
                                                        &groups, NULL),
                                     SPHPA_OK);
                    size_t wanted = brute_friends(&c, link, masked ? mask : NULL, expected);
                    assert_int_equal(groups, wanted);
                    for (size_t i = 0; i < n; i++) assert_int_equal(labels[i], expected[i]);
                    if (kind == LATTICE && !masked) assert_int_equal(groups, n); /* strict */
                    several += groups > 3 && groups < n / 2;
                    cloud_free(&c);
                }
    assert_true(several > 20); /* the cases are not all trivial */
    sphpa_tree_free(&tree);
}

/* link 0 joins nobody, not even on one point; an all-masked set has no groups */
static void test_friends_edges(void **state) {
    (void)state;
    double x[9] = {0, 0, 0, 0, 0, 0, 1, 0, 0}, support[3] = {1, 1, 1}, link[3] = {0, 0, 0};
    unsigned char mask[3] = {0, 0, 0};
    int32_t labels[3] = {7, 7, 7};
    size_t groups = 9;
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    assert_int_equal(sphpa_tree_build(&tree, 3, 3, x, support, NULL, NULL), SPHPA_OK);
    assert_int_equal(sphpa_tree_friends(&tree, link, NULL, labels, &groups, NULL), SPHPA_OK);
    assert_int_equal(groups, 3);
    for (int i = 0; i < 3; i++) assert_int_equal(labels[i], i);
    link[0] = 2.1; /* 0 and 2: (2.1 + 0)/2 > 1; 0 and 1 too */
    assert_int_equal(sphpa_tree_friends(&tree, link, NULL, labels, &groups, NULL), SPHPA_OK);
    assert_int_equal(groups, 1);
    assert_int_equal(sphpa_tree_friends(&tree, link, mask, labels, &groups, NULL), SPHPA_OK);
    assert_int_equal(groups, 0);
    for (int i = 0; i < 3; i++) assert_int_equal(labels[i], -1);
    sphpa_tree_free(&tree);
}

/* ---- errors ---------------------------------------------------------------------------------- */

static void expect_build(sphpa_tree *tree, const cloud *c, sphpa_result result, const char *has,
                         const char *also) {
    sphpa_error err;
    memset(&err, 0, sizeof err);
    sphpa_result got = sphpa_tree_build(tree, c->dim, c->n, c->x, c->support, periodic(c), &err);
    assert_int_equal(got, result);
    assert_int_equal(err.result, result);
    if (!strstr(err.message, has) || !strstr(err.message, also))
        fail_msg("message \"%s\" lacks \"%s\" or \"%s\"", err.message, has, also);
    assert_int_equal(tree->n, 64); /* the last good tree is still there */
}

static void test_build_errors(void **state) {
    (void)state;
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    cloud c = cloud_make(UNIFORM, 3, 64, 1, 1.0, 0.0, 2), bad = c;
    build(&tree, &c);
    bad.n = 0;
    expect_build(&tree, &bad, SPHPA_ERROR_EMPTY, "n is 0", "");
    bad = c;
    bad.dim = 4;
    expect_build(&tree, &bad, SPHPA_ERROR_RANGE, "dim is 4", "1, 2 or 3");
    bad.dim = 0;
    expect_build(&tree, &bad, SPHPA_ERROR_RANGE, "dim is 0", "");
    bad = c;
    bad.x = NULL;
    expect_build(&tree, &bad, SPHPA_ERROR_MISSING, "x is NULL", "");
    bad = c;
    bad.support = NULL;
    expect_build(&tree, &bad, SPHPA_ERROR_MISSING, "support is NULL", "");
    if (sizeof(size_t) > 4) {
        bad = c;
        bad.n = (size_t)UINT32_MAX; /* 2^32 - 1 */
        expect_build(&tree, &bad, SPHPA_ERROR_RANGE, "4294967295", "2^32 - 2");
    }
    tree.leaf_size = -1;
    expect_build(&tree, &c, SPHPA_ERROR_RANGE, "leaf_size is -1", "");
    tree.leaf_size = 0;
    c.box.high[0] = c.box.low[0];
    expect_build(&tree, &c, SPHPA_ERROR_RANGE, "0 to 0 m", "low < high");
    c.box.high[0] = (double)NAN;
    expect_build(&tree, &c, SPHPA_ERROR_NOT_FINITE, "nan", "axis 0");
    assert_int_equal(sphpa_tree_build(NULL, 3, 64, c.x, c.support, NULL, NULL),
                     SPHPA_ERROR_MISSING);
    sphpa_tree_free(&tree);
    sphpa_tree_free(NULL);
    cloud_free(&c);
}

static void test_particle_errors(void **state) {
    (void)state;
    sphpa_tree tree;
    memset(&tree, 0, sizeof tree);
    cloud c = cloud_make(UNIFORM, 3, 64, 1, 1.0, 0.0, 2);
    build(&tree, &c);
    static const double value[6] = {(double)NAN, (double)INFINITY, 0.0, -2.5, 1e-200, 1e200};
    static const sphpa_result code[6] = {SPHPA_ERROR_NOT_FINITE, SPHPA_ERROR_NOT_FINITE,
                                         SPHPA_ERROR_NEGATIVE,   SPHPA_ERROR_NEGATIVE,
                                         SPHPA_ERROR_RANGE,      SPHPA_ERROR_RANGE};
    static const char *const says[6] = {"nan", "inf", "is 0 m", "-2.5", "1e-200", "1e+200"};
    for (int v = 0; v < 6; v++) {
        double kept = c.support[11];
        c.support[11] = value[v];
        expect_build(&tree, &c, code[v], "support[11]", says[v]);
        c.support[11] = kept;
    }
    static const double place[4] = {(double)NAN, -(double)INFINITY, -0.001, 1.25};
    for (int v = 0; v < 4; v++) {
        double kept = c.x[3 * 21];
        c.x[3 * 21] = place[v];
        expect_build(&tree, &c, v < 2 ? SPHPA_ERROR_NOT_FINITE : SPHPA_ERROR_OUTSIDE, "x[21][0]",
                     v == 0 ? "nan" : v == 1 ? "-inf" : v == 2 ? "box 0 to 1 m" : "1.25");
        c.x[3 * 21] = kept;
    }
    c.x[3 * 21 + 2] = 1e151;
    expect_build(&tree, &c, SPHPA_ERROR_RANGE, "x[21][2]", "1e+151");
    c.x[3 * 21 + 2] = 0.1;
    c.support[5] = 0.51;
    expect_build(&tree, &c, SPHPA_ERROR_RANGE, "support[5] is 0.51", "larger box");
    c.support[5] = 0.5; /* exactly half is allowed */
    build(&tree, &c);
    sphpa_tree_free(&tree);
    cloud_free(&c);
}

static void test_other_errors(void **state) {
    (void)state;
    sphpa_tree tree;
    sphpa_tree_lists lists;
    sphpa_tree_list list;
    sphpa_error err;
    memset(&tree, 0, sizeof tree);
    memset(&lists, 0, sizeof lists);
    memset(&list, 0, sizeof list);
    double x[3] = {0.5, 0.5, 0.5}, far[3] = {1.5, 0.5, 0.5}, nan[3] = {0.5, (double)NAN, 0.5};
    double link[64];
    int32_t labels[64];
    size_t groups = 99;
    for (size_t i = 0; i < 64; i++) {
        link[i] = 0.1;
        labels[i] = 7;
    }
    assert_int_equal(sphpa_tree_neighbours(&tree, 0, &list), SPHPA_ERROR_EMPTY);
    assert_int_equal(sphpa_tree_query(&tree, x, 1.0, &list), SPHPA_ERROR_EMPTY);
    assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_ERROR_EMPTY);
    assert_int_equal(sphpa_tree_friends(&tree, link, NULL, labels, NULL, NULL), SPHPA_ERROR_EMPTY);
    cloud c = cloud_make(UNIFORM, 3, 64, 1, 1.0, 0.0, 2);
    build(&tree, &c);
    assert_int_equal(sphpa_tree_neighbours(&tree, 64, &list), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_tree_neighbours(&tree, 0, NULL), SPHPA_ERROR_MISSING);
    assert_int_equal(sphpa_tree_query(&tree, x, 0.0, &list), SPHPA_ERROR_NEGATIVE);
    assert_int_equal(sphpa_tree_query(&tree, x, (double)NAN, &list), SPHPA_ERROR_NOT_FINITE);
    assert_int_equal(sphpa_tree_query(&tree, nan, 0.1, &list), SPHPA_ERROR_NOT_FINITE);
    assert_int_equal(sphpa_tree_query(&tree, far, 0.1, &list), SPHPA_ERROR_OUTSIDE);
    assert_int_equal(sphpa_tree_query(&tree, x, 0.51, &list), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_tree_query(&tree, x, 0.5, &list), SPHPA_OK);
    assert_int_equal(sphpa_tree_lists_build(&tree, -0.1, 1, &lists, &err), SPHPA_ERROR_NEGATIVE);
    assert_non_null(strstr(err.message, "-0.1"));
    assert_int_equal(sphpa_tree_lists_build(&tree, (double)NAN, 1, &lists, &err),
                     SPHPA_ERROR_NOT_FINITE);
    assert_int_equal(sphpa_tree_lists_build(&tree, 0.9, 1, &lists, &err), SPHPA_ERROR_RANGE);
    assert_non_null(strstr(err.message, "smaller skin")); /* 1.9 * 0.2875 > 0.5 */
    assert_int_equal(sphpa_tree_lists_build(&tree, 0.5, 1, NULL, &err), SPHPA_ERROR_MISSING);
    static const double bad[3] = {(double)NAN, -1.0, 0.6};
    static const sphpa_result code[3] = {SPHPA_ERROR_NOT_FINITE, SPHPA_ERROR_NEGATIVE,
                                         SPHPA_ERROR_RANGE};
    for (int v = 0; v < 3; v++) {
        link[9] = bad[v];
        assert_int_equal(sphpa_tree_friends(&tree, link, NULL, labels, &groups, &err), code[v]);
        assert_non_null(strstr(err.message, "link[9]"));
        assert_true(labels[0] == 7 && groups == 99);
    }
    sphpa_tree_free(&tree);
    sphpa_tree_lists_free(&lists);
    sphpa_tree_list_free(&list);
    cloud_free(&c);
}

/* every allocation fails in turn: a clean error, nothing lost, and the next try works */
static void test_out_of_memory(void **state) {
    (void)state;
    int before = blocks_alive, failures = 0;
    cloud c = cloud_make(UNIFORM, 3, 1500, 0, 1.0, 0.0, 2);
    double *link = (double *)calloc(c.n, sizeof *link);
    int32_t *labels = (int32_t *)calloc(c.n, sizeof *labels);
    assert_true(link != NULL && labels != NULL);
    sphpa_tree tree;
    sphpa_tree_lists lists;
    sphpa_tree_list list;
    for (int k = 0; k < 200; k++) {
        memset(&tree, 0, sizeof tree);
        memset(&lists, 0, sizeof lists);
        memset(&list, 0, sizeof list);
        fail_after = k;
        refused = 0;
        sphpa_result result = sphpa_tree_build(&tree, 3, c.n, c.x, c.support, NULL, NULL);
        if (result != SPHPA_OK) assert_int_equal(tree.n, 0);
        if (result == SPHPA_OK) {
            result = sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL);
            if (result != SPHPA_OK) assert_true(lists.n == 0 && lists.chunk_count == 0);
        }
        if (result == SPHPA_OK) result = sphpa_tree_friends(&tree, link, NULL, labels, NULL, NULL);
        if (result == SPHPA_OK) result = sphpa_tree_neighbours(&tree, 3, &list);
        int all = !refused;
        fail_after = -1;
        assert_int_equal(result, all ? SPHPA_OK : SPHPA_ERROR_MEMORY);
        failures += !all;
        build(&tree, &c); /* with memory again, in the same structs */
        assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_OK);
        if (k % 8 == 0) check_lists(&c, &tree, 0.0, &lists);
        sphpa_tree_free(&tree);
        sphpa_tree_lists_free(&lists);
        sphpa_tree_list_free(&list);
        assert_int_equal(blocks_alive, before);
        if (all) break;
    }
    assert_true(failures > 15 && failures < 200);
    free(link);
    free(labels);
    cloud_free(&c);
}

/* lists that grow and find no memory must still be good for the smaller ones before */
static void test_lists_out_of_memory(void **state) {
    (void)state;
    cloud c = cloud_make(UNIFORM, 3, 1500, 0, 1.0, 0.0, 2);
    sphpa_tree tree;
    sphpa_tree_lists lists;
    memset(&tree, 0, sizeof tree);
    build(&tree, &c);
    int failures = 0;
    for (int k = 0; k < 400; k++) {
        memset(&lists, 0, sizeof lists);
        assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_OK);
        fail_after = k;
        sphpa_result result = sphpa_tree_lists_build(&tree, 0.5, 1, &lists, NULL);
        fail_after = -1;
        failures += result == SPHPA_ERROR_MEMORY;
        if (k % 4 == 0) check_lists(&c, &tree, 0.0, &lists);
        assert_int_equal(sphpa_tree_lists_build(&tree, 0.0, 1, &lists, NULL), SPHPA_OK);
        size_t sum = 0, count;
        for (size_t i = 0; i < c.n; i++) {
            const uint32_t *list = sphpa_tree_list_of(&lists, i, &count);
            for (size_t m = 0; m < count; m++) sum += list[m] != i;
        }
        assert_int_equal(sum + c.n, lists.entries);
        sphpa_tree_lists_free(&lists);
        if (result == SPHPA_OK) break;
    }
    assert_true(failures > 5 && failures < 400);
    sphpa_tree_free(&tree);
    cloud_free(&c);
}

static void test_no_leak(void **state) { /* the last test: every block of the others was freed */
    (void)state;
    assert_int_equal(blocks_alive, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_behind),
        cmocka_unit_test(test_sweep_1d),       cmocka_unit_test(test_sweep_2d),
        cmocka_unit_test(test_sweep_3d),       cmocka_unit_test(test_many),
        cmocka_unit_test(test_lattice_count),  cmocka_unit_test(test_boundary),
        cmocka_unit_test(test_one_and_many_coincident),
        cmocka_unit_test(test_ignored_columns), cmocka_unit_test(test_query),
        cmocka_unit_test(test_order_is_a_hilbert_curve),    cmocka_unit_test(test_clump_leaves),
        cmocka_unit_test(test_threads),        cmocka_unit_test(test_reuse),
        cmocka_unit_test(test_dx),             cmocka_unit_test(test_coincident),
        cmocka_unit_test(test_friends),        cmocka_unit_test(test_friends_edges),
        cmocka_unit_test(test_build_errors),   cmocka_unit_test(test_particle_errors),
        cmocka_unit_test(test_other_errors),
        cmocka_unit_test(test_out_of_memory),  cmocka_unit_test(test_lists_out_of_memory),
        cmocka_unit_test(test_no_leak),
    };
    return cmocka_run_group_tests_name("tree", tests, NULL, NULL);
}
