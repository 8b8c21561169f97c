/* blast.c: 1 kt (or another yield) in a cylinder of dense air, one metre of it, in still air: by
   finite volumes, by particles and by the hybrid of both, against the converged solution in one
   dimension. After Myers, Musk, Palmer & Palmer 2024, Front. Phys. 11, 1325294 ("the paper" here).

   The paper states the yields, the density of the charge (1000 kg/m3), the air (1.225 kg/m3, 102
   kPa), dx = 0.2 m, a mesh 4 times as coarse (here twice: cells cost little), the first steps, the
   growing domains, the Gaussian and eta = 1.5. Its radius of the charge, gamma, g1, g2 and thresholds
   are not stated in its text: those here are assumptions, and all are options. Every parameter is
   printed before a run.

   This file has the options and the order of things; the runs are in blast_methods.h, what is
   measured in blast_measure.h, logs and tables in blast_output.h, pictures in blast_draw.h. */
#include "example.h"

#define SPHPA_HYBRID_IMPLEMENTATION
#include "sphpa.h"

#define BLAST_TIMES 64       /* outputs, at most */
#define BLAST_CONVERGED 16   /* spacings of --convergence, at most */
#define BLAST_SAMPLES 8      /* along dx, where squares of several sizes are filled */
#define BLAST_MARGIN 6       /* dx: a signal so close to its edge makes a domain grow */
#define BLAST_JOULES 4.184e12 /* [J] of a kiloton */
#define BLAST_PI 3.14159265358979323846
#define BLAST_EARLY 18e-6 /* [s] until then steps follow dt0 step^2 (the paper, equation 25) */

/* ---- settings -------------------------------------------------------------------------------- */

#define BLAST_METHOD_WORDS "all|fvm|sph|hybrid|reference" /* words of the options */
#define BLAST_SCHEME_WORDS "gsph|adke|mpm|sph"
#define BLAST_KERNEL_WORDS \
    "cubic|quartic|quintic|wendland-c2|wendland-c4|wendland-c6|gaussian"
#define BLAST_RIEMANN_WORDS "exact|van-leer|hllc|strong"
#define BLAST_SLOPES_WORDS "middle|van-leer|inutsuka|flat"
#define BLAST_FLAG_WORDS "both|pressure|density"
#define BLAST_COUPLING_WORDS "conservative|published"
#define BLAST_DENSITY_WORDS "number|mass"
#define BLAST_DOMAIN_WORDS "grow|fixed"

enum { BLAST_FVM = 0, BLAST_SPH, BLAST_HYBRID, BLAST_METHODS };
enum { BLAST_GSPH = 0, BLAST_ADKE, BLAST_MPM, BLAST_GAS };
enum { BLAST_ALL = 0, BLAST_ONLY_FVM, BLAST_ONLY_SPH, BLAST_ONLY_HYBRID, BLAST_ONLY_REFERENCE };

/* The case and how it is solved: what the command line sets, then with its defaults filled in. */
typedef struct blast_settings {
    double yield;          /* [kt] of one metre of the cylinder */
    double radius;         /* [m] of the charge */
    double rho_charge;     /* [kg/m3] */
    double rho_air, P_air; /* [kg/m3] [Pa] */
    double gamma;          /* [1] */
    double dx;             /* [m] spacing of particles and of the cells of finite volumes alone */
    double size;           /* [m] side of a fixed domain and of the hybrid's */
    double t_end;          /* [s] */
    double dt_start;       /* [s] dt0; 0: the particles' own limits alone */
    double cfl, cfl_mesh;  /* [1] of particles, of cells */
    double eta, pilot;     /* [1] h in units of the spacing; C of the pilot density */
    double g1, g2;         /* [1] conduction */
    double h_max;          /* [m] of a particle's smoothing length; 0: no bound */
    double threshold;      /* [1] relative difference that flags a cell */
    double merge;          /* [1] share of a new particle that two may have to become one */
    double tolerance;      /* [1] of the reference's shock radius */
    double max_seconds;    /* [s] wall clock of a run; 0: no limit */
    long beta, active, buffer;
    long split;            /* particles along dx where the charge is */
    int scheme, kernel, riemann, slopes, by_mass, flag_by, published, fixed;
    int times;
    double time[BLAST_TIMES]; /* [s] of the outputs, ascending; the last is t_end */
} blast_settings;

/* What is run and what is made of it. */
typedef struct blast_options {
    long threads;
    int method, kernels, pictures, quiet;
    const char *out, *times, *convergence;
    const volatile int *stop;
} blast_options;

static blast_settings blast_default_settings(void) {
    blast_settings s;
    memset(&s, 0, sizeof s);
    s.yield = 1.0;
    s.rho_charge = 1000.0;
    s.rho_air = 1.225;
    s.P_air = 102e3;
    s.gamma = 1.4;
    s.dx = 0.2;
    s.t_end = 1e-3;
    s.dt_start = -1.0;
    s.cfl = 0.3;
    s.cfl_mesh = 0.8;
    s.eta = 1.5;
    s.pilot = 2.5;
    s.g1 = 0.25;
    s.g2 = 0.5;
    s.threshold = 0.3;
    s.tolerance = 1e-3;
    s.active = 1;
    s.kernel = SPHPA_KERNEL_GAUSSIAN;
    s.slopes = SPHPA_GODUNOV_VAN_LEER;
    return s;
}

static const char *blast_word(const char *words, int k, char text[32]) {
    size_t length = 0;
    const char *word = example_word_(words, k, &length);
    snprintf(text, 32, "%.*s", (int)length, word != NULL ? word : "?");
    return text;
}

static const char *blast_method_name(int method) {
    static const char *const name[BLAST_METHODS + 1] = {"fvm", "sph", "hybrid", "reference"};
    return name[method];
}

static double blast_energy(const blast_settings *s) { return s->yield * BLAST_JOULES; }

static double blast_charge_pressure(const blast_settings *s) {
    return (s->gamma - 1.0) * blast_energy(s) / (BLAST_PI * s->radius * s->radius);
}

/* [m] where Sedov's strong shock of a line in air would be: the charge's mass only slows it */
static double blast_sedov_radius(const blast_settings *s, double t) {
    return pow(blast_energy(s) * t * t / s->rho_air, 0.25);
}

#include "blast_measure.h"
#include "blast_methods.h"
#include "blast_output.h"
#include "blast_draw.h"

/* ---- options --------------------------------------------------------------------------------- */

/* numbers with commas between, ascending; returns how many */
static int blast_list(const char *option, const char *text, double unit, double *list, int most) {
    int count = 0;
    for (const char *at = text; count == 0 || *at != '\0';) {
        char *stop = NULL;
        double value = strtod(at, &stop);
        if (stop == at || !(value > 0.0) || !(value < 1e300) || (*stop != ',' && *stop != '\0') ||
            (*stop == ',' && stop[1] == '\0'))
            example_fail(2, "--%s %s: not positive numbers with commas between", option, text);
        if (count >= most)
            example_fail(2, "--%s %.60s...: more than %d numbers; give fewer", option, text, most);
        list[count++] = value * unit;
        at = *stop == ',' ? stop + 1 : stop;
    }
    return count;
}

/* --times as far as t_end, and t_end itself */
static void blast_set_times(blast_settings *s, const char *text) {
    double all[BLAST_TIMES - 1];
    int count = blast_list("times", text, 1e-6, all, BLAST_TIMES - 1);
    for (int k = 1; k < count; k++)
        if (!(all[k] > all[k - 1]))
            example_fail(2, "--times %s: %g us comes after %g us; write them in order", text,
                         1e6 * all[k], 1e6 * all[k - 1]);
    s->times = 0;
    for (int k = 0; k < count && all[k] < s->t_end * (1.0 - 1e-9); k++) s->time[s->times++] = all[k];
    s->time[s->times++] = s->t_end;
}

static void blast_check(const blast_settings *s, const blast_options *o) {
    if (strlen(o->out) > 960)
        example_fail(2, "--out %.60s...: give a name of at most 960 characters", o->out);
    if (o->kernels && o->convergence != NULL)
        example_fail(2, "--kernels and --convergence are jobs of their own; give one");
    if (o->kernels && o->method != BLAST_ALL && o->method != BLAST_ONLY_SPH &&
        o->method != BLAST_ONLY_HYBRID)
        example_fail(2, "--kernels: of particles; give --method sph, hybrid or all");
    double dx[BLAST_CONVERGED];
    if (o->convergence != NULL)
        (void)blast_list("convergence", o->convergence, 1.0, dx, BLAST_CONVERGED);
    if (o->convergence != NULL && o->method == BLAST_ONLY_REFERENCE)
        example_fail(2, "--convergence: the reference has cells of its own; give another --method");
    if (s->scheme != BLAST_GSPH && (o->method == BLAST_ALL || o->method == BLAST_ONLY_HYBRID))
        example_fail(2, "--scheme %s: the hybrid's particles are gsph; give --method sph",
                     blast_word(BLAST_SCHEME_WORDS, s->scheme, (char[32]){0}));
    if (s->scheme == BLAST_ADKE && !s->fixed && o->method == BLAST_ONLY_SPH)
        example_fail(2, "--scheme adke: beside the charge its smoothing lengths in air reach across "
                        "the domain that a growing one begins with; give --domain fixed");
    if (!(s->rho_charge > s->rho_air))
        example_fail(2, "--rho-charge %g: not above the air's %g kg/m3", s->rho_charge, s->rho_air);
    if (!(blast_charge_pressure(s) > 10.0 * s->P_air))
        example_fail(2, "--yield %g: the charge's pressure, %.3g Pa, is below ten times that of the "
                        "air; give a larger --yield or a smaller --radius", s->yield,
                     blast_charge_pressure(s));
    if (s->radius < 0.5 * s->dx)
        example_fail(2, "--radius %g: less than half of dx = %g m; give a smaller --dx", s->radius,
                     s->dx);
    if (s->size > 0.0 && s->size < 2.0 * (s->radius + BLAST_MARGIN * s->dx))
        example_fail(2, "--size %g: the charge and %d particles of air around it need %.3g m",
                     s->size, BLAST_MARGIN, 2.0 * (s->radius + BLAST_MARGIN * s->dx));
}

/* what 0 or less stands for */
static void blast_fill_in(blast_settings *s) {
    double scale = pow(s->yield, log10(2.0)); /* 1 for 1 kt, 2 for 10 kt: the default cases */
    if (s->radius == 0.0) s->radius = scale;
    if (s->dt_start < 0.0) s->dt_start = 6.25e-11 / scale;
    if (s->published && s->buffer == 0) s->buffer = 1;
    if (s->beta == 0) s->beta = s->published ? 4 : 2;
    if (s->split == 0) s->split = s->published ? 1 : 8;
}

static void blast_parse(int argc, char **argv, blast_settings *s, blast_options *o) {
    const example_option options[] = {
        example_number("yield", "kt", &s->yield, 1e-9, 1e6, "of one metre of the cylinder"),
        example_number("radius", "m", &s->radius, 0.0, 1e3,
                       "of the charge; 0: 1 m at 1 kt, 2 m at 10 kt, as yield^0.301"),
        example_number("rho-charge", "kg/m3", &s->rho_charge, 1e-6, 1e6, "density of the charge"),
        example_number("rho-air", "kg/m3", &s->rho_air, 1e-6, 1e6, "density of the air"),
        example_number("P-air", "Pa", &s->P_air, 1e-6, 1e9, "its pressure"),
        example_number("gamma", "1", &s->gamma, 1.01, 3.0, "ratio of specific heats, of both"),
        example_choice("method", BLAST_METHOD_WORDS, &o->method, "the reference is always there"),
        example_choice("scheme", BLAST_SCHEME_WORDS, &s->scheme,
                       "of particles alone; sph: summed density, artificial viscosity"),
        example_choice("kernel", BLAST_KERNEL_WORDS, &s->kernel, "of the particles"),
        example_choice("riemann", BLAST_RIEMANN_WORDS, &s->riemann, "solver of gsph"),
        example_choice("slopes", BLAST_SLOPES_WORDS, &s->slopes,
                       "limiter of gsph; van-leer keeps u above 0 best where P jumps a millionfold"),
        example_choice("density", BLAST_DENSITY_WORDS, &s->by_mass,
                       "of gsph: particles are counted, or their masses summed, as the paper's"),
        example_number("eta", "1", &s->eta, 0.8, 3.0, "smoothing length in units of the spacing"),
        example_number("h-max", "m", &s->h_max, 0.0, 1e6, "smoothing lengths stay below; 0: no bound"),
        example_number("pilot", "1", &s->pilot, 1.0, 4.0, "supports of gsph's pilot density"),
        example_number("g1", "1", &s->g1, 0.0, 10.0, "conduction, linear"),
        example_number("g2", "1", &s->g2, 0.0, 10.0, "conduction, quadratic"),
        example_number("cfl", "1", &s->cfl, 1e-3, 1.0, "Courant number of the particles"),
        example_number("cfl-mesh", "1", &s->cfl_mesh, 1e-3, 1.0, "Courant number of meshes"),
        example_number("dt-start", "s", &s->dt_start, -1.0, 1.0,
                       "particles' steps <= this step^2 until 18 us; 0: no; -1: the paper's"),
        example_number("dx", "m", &s->dx, 1e-4, 100.0, "spacing of particles, cells of fvm"),
        example_count("split", &s->split, 0, 64,
                      "particles along dx where the charge is; 0: 8, or the paper's 1 with its coupling"),
        example_count("beta", &s->beta, 0, 64,
                      "hybrid: the mesh is so many times coarser; 0: 2, or the paper's 4 with its coupling"),
        example_count("active", &s->active, 0, 1000, "hybrid: cells of particles around flagged"),
        example_count("buffer", &s->buffer, 0, 1000,
                      "hybrid: cells of driven particles around; 0: what their sums need"),
        example_number("threshold", "1", &s->threshold, 0.0, 1e9,
                       "hybrid: relative difference of cells that flags; 0: all"),
        example_choice("flag", BLAST_FLAG_WORDS, &s->flag_by, "hybrid: by what"),
        example_number("merge", "1", &s->merge, -1.0, 1.0,
                       "hybrid: two of no more than this share of a new one's area become one; 0: 1; -1: none"),
        example_choice("coupling", BLAST_COUPLING_WORDS, &s->published,
                       "hybrid; published: the paper's means, buffer 1, which leak"),
        example_choice("domain", BLAST_DOMAIN_WORDS, &s->fixed,
                       "of fvm and sph: as the paper's, or at once as large as the hybrid's"),
        example_number("size", "m", &s->size, 0.0, 1e5,
                       "side of the hybrid's and of fixed domains; 0: holds the shock at t-end"),
        example_number("t-end", "s", &s->t_end, 1e-9, 10.0, "end of the run"),
        example_text("times", "T,T,..", &o->times, "[us] outputs until then"),
        example_number("tolerance", "1", &s->tolerance, 1e-6, 0.1,
                       "reference: change of its shock radii when its cells are doubled"),
        example_number("max-seconds", "s", &s->max_seconds, 0.0, 1e9,
                       "ends each run after so long; 0: no"),
        example_text("convergence", "DX,DX,..", &o->convergence,
                     "[m] also run these: error against run time"),
        example_flag("kernels", &o->kernels, "instead: one run for each kernel, as a table"),
        example_text("out", "DIR", &o->out, "where files and pictures go"),
        example_switch("pictures", &o->pictures, "draw them"),
        example_count("threads", &o->threads, 0, 4096, "0: as many as there are"),
        example_flag("quiet", &o->quiet, "no progress on stderr")};
    example_parse(argc, argv,
                  "a blast by finite volumes, particles and both, against the 1-D solution\n\n"
                  "Shock radius R: outermost radius where the azimuthal mean of P is half of its\n"
                  "outer shell's maximum: from outside, the first one above 3 P-air that a fall of\n"
                  "5 % follows; where that is more than twice the reference's there is no shell yet:\n"
                  "then half of the reference's maximum (* in tables). Peak density: of the mean\n"
                  "in that shell. Means in rings dx wide. L1: mean over the disc of 1.2 R of the reference of |mean rho - reference's rho|,\n"
                  "weighted by area, over rho-air. Drifts: of what there was, air of growing domains\n"
                  "added, less what left, relative to it; momentum to sqrt(2 M E). CPU: seconds of\n"
                  "all threads, without output", SPHPA_VERSION, options,
                  (int)(sizeof options / sizeof options[0]));
}

/* ---- what is run ----------------------------------------------------------------------------- */

static bool blast_wants(const blast_options *o, int method) {
    return o->method == BLAST_ALL || o->method == method + 1;
}

/* the next dx of the paper's pictures of error against time; the case's own last */
static void blast_converge(const blast_settings *s, const blast_options *o,
                           const blast_reference *reference, const blast_result *own,
                           blast_report *report) {
    double dx[BLAST_CONVERGED];
    int count = blast_list("convergence", o->convergence, 1.0, dx, BLAST_CONVERGED);
    static blast_result result;
    blast_points points;
    memset(&points, 0, sizeof points);
    for (int k = 0; k < count && !*o->stop; k++)
        for (int method = 0; method < BLAST_METHODS && !*o->stop; method++) {
            blast_settings at = *s;
            if (!blast_wants(o, method) || dx[k] == s->dx) continue;
            at.dx = dx[k];
            blast_solve(&at, o, method, reference, NULL, &result);
            blast_add_point(&points, &at, reference, &result);
        }
    for (int method = 0; method < BLAST_METHODS; method++)
        if (blast_wants(o, method)) blast_add_point(&points, s, reference, &own[method]);
    blast_tell_points(&points, s, o->out, report);
    if (o->pictures) blast_draw_points(&points, s, o->out);
}

static int blast_kernels(const blast_settings *s, const blast_options *o,
                         const blast_reference *reference, blast_report *report) {
    static blast_result result;
    int method = o->method == BLAST_ONLY_HYBRID ? BLAST_HYBRID : BLAST_SPH;
    blast_kernel_head(method, s, report);
    for (int k = 0; k < SPHPA_KERNEL_COUNT && !*o->stop; k++) {
        blast_settings at = *s;
        at.kernel = k;
        blast_solve(&at, o, method, reference, NULL, &result);
        blast_kernel_row(&at, reference, &result, report);
    }
    blast_keep_report(report, o->out);
    return *o->stop ? 130 : 0;
}

/* the exit status: 130 where it was interrupted, 1 where a run failed */
static int blast_compare(const blast_settings *s, const blast_options *o,
                         const blast_reference *reference, blast_report *report) {
    static blast_result result[BLAST_METHODS];
    int status = 0;
    for (int method = 0; method < BLAST_METHODS; method++) {
        result[method].method = method;
        if (!blast_wants(o, method) || *o->stop) continue;
        blast_solve(s, o, method, reference, o->out, &result[method]);
        if (result[method].failed) status = 1;
    }
    if (o->method != BLAST_ONLY_REFERENCE) blast_tell_table(result, s, reference, report);
    blast_keep_report(report, o->out);
    if (*o->stop) return 130;
    if (o->pictures) blast_draw_all(result, s, reference, o->out);
    if (o->convergence != NULL) blast_converge(s, o, reference, result, report);
    blast_keep_report(report, o->out);
    return *o->stop ? 130 : status;
}

int main(int argc, char **argv) {
    blast_settings s = blast_default_settings();
    blast_options o;
    static blast_report report;
    static blast_reference reference;
    memset(&o, 0, sizeof o);
    o.pictures = 1;
    o.threads = 1;
    o.out = "build/blast";
    o.times = "18,50,100,225,398,631,1000";
    blast_parse(argc, argv, &s, &o);
    blast_fill_in(&s);
    blast_set_times(&s, o.times);
    blast_check(&s, &o);
    int threads = example_threads(o.threads);
    example_folder(o.out);
    o.stop = example_stop_on_interrupt();
    blast_tell_case(&s, threads, &report);
    int status = blast_find_reference(&s, &o, &reference, &report);
    if (status == 0) blast_set_size(&s, &reference, &report);
    if (status == 0) status = o.kernels ? blast_kernels(&s, &o, &reference, &report)
                                        : blast_compare(&s, &o, &reference, &report);
    if (status == 130) fprintf(stderr, "blast: interrupted\n");
    blast_reference_free(&reference);
    if (fflush(stdout) != 0 || ferror(stdout))
        example_fail(1, "cannot write to standard output (%s)", strerror(errno));
    return status;
}
