/* The field table and the sets made of it: memory, growth, sorting, columns, checks. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

/* memory that runs out when told to, and is never zero or aligned by luck */
static size_t blocks_left = (size_t)-1;
static int blocks_alive = 0;
static void *scarce_malloc(size_t bytes);
static void scarce_free(void *block);
#define SPHPA_MALLOC(bytes) scarce_malloc(bytes)
#define SPHPA_REALLOC(block, bytes) realloc(block, bytes)
#define SPHPA_FREE(block) scarce_free(block)

#define SPHPA_PARTICLES_IMPLEMENTATION
#include "sphpa.h"

#include "near.h"

static void *scarce_malloc(size_t bytes) {
    if (blocks_left == 0) return NULL;
    blocks_left--;
    char *block = (char *)malloc(bytes + 8);
    if (block == NULL) return NULL;
    memset(block, 0xA5, bytes + 8);
    blocks_alive++;
    return block + 8; /* aligned to 8, and never to 16 or 64 */
}

static void scarce_free(void *block) {
    if (block == NULL) return;
    blocks_alive--;
    free((char *)block - 8);
}

#define REAL_BYTES sizeof(sphpa_real)

/* every field, a copy of each state field, two columns */
static sphpa_particles full_set(size_t capacity) {
    sphpa_mask all = 0, state = 0;
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        all |= (sphpa_mask)1 << k;
        if (sphpa_field_describe((sphpa_field)k).role == SPHPA_ROLE_STATE)
            state |= (sphpa_mask)1 << k;
    }
    sphpa_column columns[2];
    memset(columns, 0, sizeof columns);
    strcpy(columns[0].name, "heat");
    strcpy(columns[1].name, "flux");
    columns[1].components = 3;
    columns[1].role = SPHPA_ROLE_DERIVED;
    sphpa_particles p;
    sphpa_error err;
    sphpa_result result = sphpa_particles_create(&p, 3, capacity, all, state, columns, 2, &err);
    assert_int_equal(result, SPHPA_OK);
    return p;
}

/* a byte pattern that tells array and particle */
static unsigned char pattern(int array, int64_t id, size_t byte) {
    return (unsigned char)(array * 37 + (int)id * 11 + (int)byte * 3 + 1);
}

static unsigned char *array_of(const sphpa_particles *p, int k, size_t *bytes) {
    int fields = (int)SPHPA_FIELD_COUNT;
    if (k < 2 * fields) {
        sphpa_field field = (sphpa_field)(k % fields);
        *bytes = sphpa_field_describe(field).bytes;
        return (unsigned char *)sphpa_particles_data(p, field, k >= fields);
    }
    k -= 2 * fields;
    *bytes = (size_t)p->column[k % 2].components * sizeof(double);
    return (unsigned char *)(k < 2 ? p->column[k].data : p->column[k - 2].start);
}

enum { ARRAYS = 2 * (int)SPHPA_FIELD_COUNT + 4 };

static void fill(sphpa_particles *p, size_t first) {
    for (int k = 0; k < ARRAYS; k++) {
        size_t bytes;
        unsigned char *data = array_of(p, k, &bytes);
        if (data == NULL || k == (int)SPHPA_FIELD_id) continue;
        if (k == (int)SPHPA_FIELD_parent) { /* these are places, and follow who is there */
            for (size_t i = first; i < p->n; i++) p->parent[i] = -1;
            continue;
        }
        for (size_t i = first; i < p->n; i++)
            for (size_t b = 0; b < bytes; b++) data[i * bytes + b] = pattern(k, p->id[i], b);
    }
}

static void verify(const sphpa_particles *p) {
    for (int k = 0; k < ARRAYS; k++) {
        size_t bytes;
        const unsigned char *data = array_of(p, k, &bytes);
        if (data == NULL || k == (int)SPHPA_FIELD_id || k == (int)SPHPA_FIELD_parent) continue;
        for (size_t i = 0; i < p->n; i++)
            for (size_t b = 0; b < bytes; b++)
                if (data[i * bytes + b] != pattern(k, p->id[i], b))
                    fail_msg("array %d, particle %d, byte %d", k, (int)i, (int)b);
    }
}

static void table_rows_describe_the_struct(void **state) {
    (void)state;
    sphpa_field_info rho = sphpa_field_describe(SPHPA_FIELD_rho);
    assert_string_equal(rho.name, "rho");
    assert_string_equal(rho.file_name, "Densities");
    assert_int_equal(rho.type, SPHPA_TYPE_double);
    assert_int_equal(rho.bytes, 8);
    assert_int_equal(rho.length, -3);
    assert_int_equal(rho.mass, 1);
    assert_int_equal(rho.role, SPHPA_ROLE_STATE);
    sphpa_field_info v = sphpa_field_describe(SPHPA_FIELD_v);
    assert_int_equal(v.components, 3);
    assert_int_equal(v.bytes, 3 * REAL_BYTES);
    assert_int_equal(v.time, -1);
    assert_int_equal(sphpa_field_describe(SPHPA_FIELD_S).bytes, 6 * REAL_BYTES);
    assert_int_equal(sphpa_field_describe(SPHPA_FIELD_m).split, SPHPA_RULE_SHARE);
    assert_int_equal(sphpa_field_describe(SPHPA_FIELD_m).merge, SPHPA_RULE_SUM);
    assert_null(sphpa_field_describe(SPHPA_FIELD_COUNT).name);
    assert_null(sphpa_field_describe((sphpa_field)1000).name);
    /* law: x, rho, u and alpha are double in every build */
    const sphpa_field exact[] = {SPHPA_FIELD_x, SPHPA_FIELD_rho, SPHPA_FIELD_u, SPHPA_FIELD_alpha};
    for (int k = 0; k < 4; k++)
        assert_int_equal(sphpa_field_describe(exact[k]).type, SPHPA_TYPE_double);
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        sphpa_field_info a = sphpa_field_describe((sphpa_field)k);
        bool small = a.type == SPHPA_TYPE_int32_t || a.type == SPHPA_TYPE_uint32_t;
        size_t size = a.type == SPHPA_TYPE_sphpa_real ? REAL_BYTES : (small ? 4 : 8);
        assert_int_equal(a.bytes, (size_t)a.components * size);
        assert_non_null(strchr(a.meaning, '[')); /* a unit */
        for (int other = 0; other < k; other++) {
            sphpa_field_info b = sphpa_field_describe((sphpa_field)other);
            assert_string_not_equal(a.name, b.name);
            assert_string_not_equal(a.file_name, b.file_name);
        }
    }
}

static void only_what_is_asked_for_is_there(void **state) {
    (void)state;
    sphpa_particles p;
    sphpa_mask ask = SPHPA_F(P) | SPHPA_F(S);
    assert_int_equal(sphpa_particles_create(&p, 2, 10, ask, SPHPA_F(rho), NULL, 0, NULL), SPHPA_OK);
    sphpa_mask want = SPHPA_BASIC_FIELDS | ask;
    size_t bytes = 8; /* the copy of rho */
    for (int k = 0; k < (int)SPHPA_FIELD_COUNT; k++) {
        bool there = ((want >> k) & 1u) != 0;
        assert_int_equal(sphpa_particles_data(&p, (sphpa_field)k, 0) != NULL, there);
        assert_int_equal(sphpa_particles_data(&p, (sphpa_field)k, 1) != NULL, k == SPHPA_FIELD_rho);
        if (there) bytes += sphpa_field_describe((sphpa_field)k).bytes;
    }
    assert_int_equal(sphpa_particles_bytes_each(&p), bytes);
    assert_ptr_equal(sphpa_particles_data(&p, SPHPA_FIELD_S, 0), p.S);
    assert_ptr_equal(sphpa_particles_data(&p, SPHPA_FIELD_rho, 1), p.start.rho);
    assert_null(p.alpha);
    assert_null(p.D);
    assert_null(sphpa_particles_data(&p, SPHPA_FIELD_COUNT, 0));
    sphpa_particles_free(&p);
    assert_null(p.block);
    assert_int_equal(blocks_alive, 0);
}

static void arrays_are_aligned_apart_and_zero(void **state) {
    (void)state;
    const size_t capacity = 13; /* no multiple of a cache line */
    sphpa_particles p = full_set(capacity);
    for (int k = 0; k < ARRAYS; k++) {
        size_t bytes, other_bytes;
        unsigned char *data = array_of(&p, k, &bytes);
        if (data == NULL) continue;
        assert_int_equal((uintptr_t)data % 64, 0);
        for (size_t b = 0; b < capacity * bytes; b++) assert_int_equal(data[b], 0);
        for (int other = 0; other < k; other++) {
            const unsigned char *there = array_of(&p, other, &other_bytes);
            if (there == NULL) continue;
            assert_true(data >= there + capacity * other_bytes || there >= data + capacity * bytes);
        }
    }
    sphpa_particles_free(&p);
}

static void growing_keeps_everything(void **state) {
    (void)state;
    sphpa_particles p = full_set(0);
    size_t first = 99;
    for (int round = 0; round < 6; round++) {
        size_t before = p.n, count = (size_t)(3 * round + 1);
        assert_int_equal(sphpa_particles_add(&p, count, &first, NULL), SPHPA_OK);
        assert_int_equal(first, before);
        assert_int_equal(p.n, before + count);
        for (size_t i = before; i < p.n; i++) assert_int_equal(p.id[i], i);
        fill(&p, before);
        verify(&p);
    }
    assert_int_equal(sphpa_particles_reserve(&p, 500, NULL), SPHPA_OK);
    assert_int_equal(p.capacity, 500);
    verify(&p);
    const void *block = p.block;
    assert_int_equal(sphpa_particles_reserve(&p, 20, NULL), SPHPA_OK); /* never shrinks */
    assert_ptr_equal(p.block, block);
    /* where particles were taken away, new ones are zero again, with new ids */
    p.n -= 5;
    int64_t next = p.next_id;
    assert_int_equal(sphpa_particles_add(&p, 5, &first, NULL), SPHPA_OK);
    for (size_t i = first; i < p.n; i++) {
        assert_int_equal(p.id[i], next + (int64_t)(i - first));
        assert_true(p.rho[i] == 0.0 && p.S[6 * i + 5] == 0 && p.start.u[i] == 0.0);
        assert_true(sphpa_particles_column(&p, "flux")[3 * i + 2] == 0.0);
    }
    sphpa_particles_free(&p);
}

/* particle id's parent: every third one has none */
static int32_t parent_of(int32_t id, int n) { return id % 3 == 1 ? -1 - id : (7 * id + 5) % n; }

/* each parent is still the particle that it was, or -1 where there is no more of that id */
static void parents_are(const sphpa_particles *p, int n) {
    for (size_t i = 0; i < p->n; i++) {
        int32_t want = parent_of((int32_t)p->id[i], n), there = -1;
        for (size_t k = 0; k < p->n && want >= 0; k++)
            if (p->id[k] == want) there = (int32_t)k;
        assert_int_equal(p->parent[i], want < 0 ? want : there);
    }
}

static void permuting_is_exact(void **state) {
    (void)state;
    enum { N = 101 };
    sphpa_particles p = full_set(N + 7);
    assert_int_equal(sphpa_particles_add(&p, N, NULL, NULL), SPHPA_OK);
    fill(&p, 0);
    uint32_t order[N];
    sphpa_rng rng = sphpa_rng_seed(1, 1);
    for (uint32_t i = 0; i < N; i++) order[i] = i;
    for (uint32_t i = N - 1; i > 0; i--) {
        uint32_t j = sphpa_rng_below(&rng, i + 1), swap = order[i];
        order[i] = order[j];
        order[j] = swap;
    }
    for (int32_t i = 0; i < N; i++) p.parent[i] = parent_of(i, N);
    assert_int_equal(sphpa_particles_permute(&p, order, NULL), SPHPA_OK);
    for (size_t i = 0; i < N; i++) assert_int_equal(p.id[i], order[i]);
    verify(&p); /* every byte of every array went where its id went */
    parents_are(&p, N);
    blocks_left = 0;
    sphpa_error err;
    assert_int_equal(sphpa_particles_permute(&p, order, &err), SPHPA_ERROR_MEMORY);
    blocks_left = (size_t)-1;
    verify(&p);
    parents_are(&p, N);
    sphpa_particles_free(&p);
}

static void removing_keeps_the_others(void **state) {
    (void)state;
    enum { N = 90 };
    sphpa_particles p = full_set(N + 3);
    unsigned char keep[N];
    sphpa_error err;
    assert_int_equal(sphpa_particles_add(&p, N, NULL, NULL), SPHPA_OK);
    fill(&p, 0);
    for (int32_t i = 0; i < N; i++) p.parent[i] = parent_of(i, N), keep[i] = 7;
    assert_int_equal(sphpa_particles_remove(&p, keep, &err), SPHPA_OK); /* none */
    assert_int_equal(p.n, N);
    size_t left = 0;
    for (size_t i = 0; i < N; i++) {
        keep[i] = i % 3 != 0 && i < 80 ? 1 : 0; /* the first, the last and between */
        left += keep[i];
    }
    blocks_left = 0;
    assert_int_equal(sphpa_particles_remove(&p, keep, &err), SPHPA_ERROR_MEMORY);
    blocks_left = (size_t)-1;
    assert_int_equal(p.n, N);
    verify(&p);
    parents_are(&p, N);
    assert_int_equal(sphpa_particles_remove(&p, keep, &err), SPHPA_OK);
    assert_int_equal(p.n, left);
    verify(&p);
    parents_are(&p, N); /* those of particles that are gone are -1 */
    for (size_t i = 1; i < p.n; i++) assert_true(p.id[i] > p.id[i - 1] && keep[p.id[i]] == 1);
    assert_int_equal(p.next_id, N); /* ids are never used again */
    memset(keep, 0, sizeof keep);
    assert_int_equal(sphpa_particles_remove(&p, keep, &err), SPHPA_OK);
    assert_int_equal(p.n, 0);
    sphpa_particles_free(&p);
    const int64_t ids[3] = {0, 2, 3}; /* a set without parents */
    assert_int_equal(sphpa_particles_create(&p, 1, 4, 0, 0, NULL, 0, NULL), SPHPA_OK);
    assert_int_equal(sphpa_particles_add(&p, 4, NULL, NULL), SPHPA_OK);
    keep[0] = keep[2] = keep[3] = 1;
    assert_int_equal(sphpa_particles_remove(&p, keep, &err), SPHPA_OK);
    assert_int_equal(p.n, 3);
    for (size_t i = 0; i < 3; i++) assert_int_equal(p.id[i], ids[i]);
    sphpa_particles_free(&p);
    assert_int_equal(blocks_alive, 0);
}

static void appending_copies_what_both_have(void **state) {
    (void)state;
    sphpa_particles from = full_set(4), to;
    assert_int_equal(sphpa_particles_add(&from, 4, NULL, NULL), SPHPA_OK);
    for (size_t i = 0; i < 4; i++) {
        from.id[i] = 40 + (int64_t)i;
        from.rho[i] = 1.0 + (double)i;
        from.x[3 * i + 1] = 2.0 + (double)i;
        from.alpha[i] = 3.0 + (double)i;
        for (size_t c = 0; c < 3; c++)
            sphpa_particles_column(&from, "flux")[3 * i + c] = (double)(10 * i + c);
        sphpa_particles_column(&from, "heat")[i] = 7.0;
    }
    from.next_id = 44;
    sphpa_column columns[3];
    memset(columns, 0, sizeof columns);
    strcpy(columns[0].name, "flux");
    columns[0].components = 3;
    strcpy(columns[1].name, "own");
    strcpy(columns[2].name, "heat");
    columns[2].components = 2; /* another shape: not the same column */
    assert_int_equal(sphpa_particles_create(&to, 3, 0, SPHPA_F(P), 0, columns, 3, NULL), SPHPA_OK);
    assert_int_equal(sphpa_particles_add(&to, 2, NULL, NULL), SPHPA_OK);
    to.rho[1] = 9.0;
    assert_int_equal(sphpa_particles_append(&to, &from, NULL), SPHPA_OK);
    assert_int_equal(to.n, 6);
    assert_int_equal(to.next_id, 44);
    assert_null(to.alpha);
    assert_true(to.rho[1] == 9.0);
    for (size_t i = 0; i < 4; i++) {
        assert_int_equal(to.id[2 + i], 40 + i);
        assert_true(to.rho[2 + i] == from.rho[i] && to.x[3 * (2 + i) + 1] == from.x[3 * i + 1]);
        assert_true(to.P[2 + i] == 0);
        assert_true(sphpa_particles_column(&to, "flux")[3 * (2 + i) + 2] == (double)(10 * i + 2));
        assert_true(sphpa_particles_column(&to, "own")[2 + i] == 0.0);
        assert_true(sphpa_particles_column(&to, "heat")[2 * (2 + i)] == 0.0);
    }
    sphpa_particles_free(&from);
    sphpa_particles_free(&to);
}

static void columns_are_found_and_checked(void **state) {
    (void)state;
    sphpa_particles p = full_set(3);
    assert_ptr_equal(sphpa_particles_column(&p, "heat"), p.column[0].data);
    assert_int_equal(p.column[0].components, 1);
    assert_non_null(p.column[0].start); /* a state has the copy */
    assert_null(p.column[1].start);     /* a derived one has none */
    assert_null(sphpa_particles_column(&p, "no such"));
    sphpa_particles_free(&p);
    sphpa_error err;
    sphpa_column columns[SPHPA_COLUMNS_MAX + 1];
    memset(columns, 0, sizeof columns);
    strcpy(columns[0].name, "one");
    strcpy(columns[1].name, "one");
    assert_int_equal(sphpa_particles_create(&p, 1, 1, 0, 0, columns, 2, &err), SPHPA_ERROR_RANGE);
    assert_non_null(strstr(err.message, "one"));
    columns[1].name[0] = '\0';
    assert_int_equal(sphpa_particles_create(&p, 1, 1, 0, 0, columns, 2, &err), SPHPA_ERROR_RANGE);
    strcpy(columns[1].name, "Densities"); /* of a field: two datasets of one name */
    assert_int_equal(sphpa_particles_create(&p, 1, 1, 0, 0, columns, 2, &err), SPHPA_ERROR_RANGE);
    strcpy(columns[1].name, "two");
    columns[1].components = 10;
    assert_int_equal(sphpa_particles_create(&p, 1, 1, 0, 0, columns, 2, &err), SPHPA_ERROR_RANGE);
    assert_int_equal(sphpa_particles_create(&p, 1, 1, 0, 0, columns, SPHPA_COLUMNS_MAX + 1, &err),
                     SPHPA_ERROR_RANGE);
    memset(columns[1].name, 'x', sizeof columns[1].name); /* no end: cut, not read on */
    columns[1].components = 1;
    assert_int_equal(sphpa_particles_create(&p, 1, 1, 0, 0, columns, 2, &err), SPHPA_OK);
    assert_int_equal(strlen(p.column[1].name), sizeof columns[1].name - 1);
    sphpa_particles_free(&p);
}

static void errors_leave_all_as_it_was(void **state) {
    (void)state;
    sphpa_particles p, empty;
    sphpa_error err;
    for (int dim = 0; dim <= 4; dim += 4) {
        assert_int_equal(sphpa_particles_create(&p, dim, 1, 0, 0, NULL, 0, &err),
                         SPHPA_ERROR_RANGE);
        assert_null(p.block);
    }
    blocks_left = 0;
    assert_int_equal(sphpa_particles_create(&p, 3, 10, 0, 0, NULL, 0, &err), SPHPA_ERROR_MEMORY);
    assert_int_equal(err.result, SPHPA_ERROR_MEMORY);
    blocks_left = (size_t)-1;
    assert_int_equal(sphpa_particles_create(&p, 3, (size_t)-1 / 50, 0, 0, NULL, 0, &err),
                     SPHPA_ERROR_MEMORY); /* the product overflows */
    p = full_set(5);
    assert_int_equal(sphpa_particles_add(&p, 5, NULL, NULL), SPHPA_OK);
    fill(&p, 0);
    blocks_left = 0;
    assert_int_equal(sphpa_particles_add(&p, 1, NULL, &err), SPHPA_ERROR_MEMORY);
    assert_int_equal(sphpa_particles_reserve(&p, 6, &err), SPHPA_ERROR_MEMORY);
    blocks_left = (size_t)-1;
    volatile size_t most = (size_t)-1; /* the sum overflows */
    assert_int_equal(sphpa_particles_add(&p, most, NULL, &err), SPHPA_ERROR_MEMORY);
    assert_int_equal(sphpa_particles_add(&p, most - 2, NULL, NULL), SPHPA_ERROR_MEMORY);
    assert_int_equal(p.n, 5);
    assert_int_equal(p.next_id, 5);
    verify(&p);
    sphpa_particles_free(&p);
    sphpa_particles_free(NULL);
    memset(&empty, 0, sizeof empty);
    assert_int_equal(sphpa_particles_add(&empty, 1, NULL, &err), SPHPA_ERROR_MISSING);
    sphpa_particles_free(&empty);
    assert_int_equal(blocks_alive, 0);
}

/* a good set of three, of which the caller spoils the second */
static sphpa_particles good_set(void) {
    sphpa_particles p = full_set(3);
    assert_int_equal(sphpa_particles_add(&p, 3, NULL, NULL), SPHPA_OK);
    for (size_t i = 0; i < 3; i++) {
        p.x[3 * i] = (double)i;
        p.m[i] = p.h[i] = (sphpa_real)1;
        p.rho[i] = p.alpha[i] = 1.0;
    }
    p.id[1] = 77;
    return p;
}

static void check_finds_each_bad_value(void **state) {
    (void)state;
    const double nan = NAN, inf = HUGE_VAL;
    const struct {
        sphpa_field field;
        size_t component;
        double value;
        sphpa_result result;
    } bad[] = {{SPHPA_FIELD_x, 2, nan, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_x, 0, -inf, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_v, 1, inf, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_v, 0, nan, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_m, 0, 0.0, SPHPA_ERROR_NEGATIVE},
               {SPHPA_FIELD_m, 0, nan, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_h, 0, -0.5, SPHPA_ERROR_NEGATIVE},
               {SPHPA_FIELD_h, 0, inf, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_rho, 0, 0.0, SPHPA_ERROR_NEGATIVE},
               {SPHPA_FIELD_rho, 0, nan, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_u, 0, nan, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_u, 0, inf, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_alpha, 0, 0.999, SPHPA_ERROR_ALPHA},
               {SPHPA_FIELD_alpha, 0, nan, SPHPA_ERROR_NOT_FINITE},
               {SPHPA_FIELD_alpha, 0, inf, SPHPA_ERROR_NOT_FINITE}};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        sphpa_particles p = good_set();
        sphpa_field_info info = sphpa_field_describe(bad[k].field);
        sphpa_error err;
        memset(&err, 0, sizeof err);
        assert_int_equal(sphpa_particles_check(&p, &err), SPHPA_OK);
        assert_int_equal(err.message[0], 0); /* no message without an error */
        size_t at = (size_t)info.components + bad[k].component;
        void *data = sphpa_particles_data(&p, bad[k].field, 0);
        if (info.type == SPHPA_TYPE_double) ((double *)data)[at] = bad[k].value;
        else ((sphpa_real *)data)[at] = (sphpa_real)bad[k].value;
        assert_int_equal(sphpa_particles_check(&p, &err), bad[k].result);
        assert_int_equal(err.result, bad[k].result);
        char name[24];
        snprintf(name, sizeof name, " %s = ", info.name);
        assert_non_null(strstr(err.message, "particle 1 (id 77)"));
        assert_non_null(strstr(err.message, name));
        assert_int_equal(sphpa_particles_check(&p, NULL), bad[k].result);
        sphpa_particles_free(&p);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(table_rows_describe_the_struct),
        cmocka_unit_test(only_what_is_asked_for_is_there),
        cmocka_unit_test(arrays_are_aligned_apart_and_zero),
        cmocka_unit_test(growing_keeps_everything),
        cmocka_unit_test(permuting_is_exact),
        cmocka_unit_test(removing_keeps_the_others),
        cmocka_unit_test(appending_copies_what_both_have),
        cmocka_unit_test(columns_are_found_and_checked),
        cmocka_unit_test(errors_leave_all_as_it_was),
        cmocka_unit_test(check_finds_each_bad_value),
    };
    return cmocka_run_group_tests_name("particles", tests, NULL, NULL);
}
