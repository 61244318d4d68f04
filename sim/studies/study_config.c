#include "sim/studies/study_config.h"

static const char *const kinds[] = {"loop", "pd", "cubes", NULL};
static const char *const keeps[] = {"summary", "tables", "run", NULL};
static const char *const randoms[] = {"each", "common", NULL};
static const char *const designs[] = {"grid",          "list",   "latin_hypercube",
                                      "one_at_a_time", "morris", NULL};
static const char *const spacings[] = {"linear", "log", NULL};
static const char *const distributions[] = {"uniform", "log_uniform", "normal", "table", NULL};
static const char *const number_laws[] = {"fixed", "uniform", "poisson", NULL};
static const char *const applies[] = {"set", "add", "multiply", NULL};

#define ALSO_DOC "JSON pointers that get the same value."
#define PATH_DOC                                                                                  \
    "What is varied: a JSON pointer into the scenario, such as "                                  \
    "\"/observers/0/sensors/0/camera/read_noise_e\", or into the study's own block of its kind, " \
    "such as \"/pd/streak_px\"."
#define NAME_DOC                                                                                   \
    "Name of its column in tables; \"\": the pointer's last part, with _offset or _factor behind " \
    "it where that is what is drawn."
#define RAW(key_, default_, doc_) \
    { .key = key_, .type = BST_CONFIG_RAW, .unit = "", .fallback = default_, .doc = doc_ }

static const bst_config_desc scenario_table[] = {
    BST_STRING(bst_study_scenario, file, NULL,
               "A scenario; a relative path starts from the study's folder."),
    BST_STRING(bst_study_scenario, name, "\"\"",
               "Its name in tables; \"\": the name in the scenario."),
    BST_CONFIG_END};

static const bst_config_desc axis_table[] = {
    BST_STRING(bst_study_axis_config, path, NULL, PATH_DOC),
    RAW("linked_paths", "[]", ALSO_DOC),
    BST_FORMER("also", "linked_paths"),
    BST_STRING(bst_study_axis_config, name, "\"\"", NAME_DOC),
    RAW("values", "[]",
        "The values one by one, of any type; else they are taken from the range from .. to."),
    BST_REAL(bst_study_axis_config, from, "", -1e300, 1e300, "0", "First value of a range."),
    BST_REAL(bst_study_axis_config, to, "", -1e300, 1e300, "0", "Last value of a range."),
    BST_INT(bst_study_axis_config, count, "", 0, 1e6, "0",
            "Values of a range, both ends among them (grid, list, one_at_a_time)."),
    BST_ENUM(bst_study_axis_config, spacing, spacings, "\"linear\"",
             "How the values of a range are spread."),
    BST_BOOL(bst_study_axis_config, integer, "false",
             "Round the values of a range to whole numbers."),
    BST_CONFIG_END};

static const bst_config_desc sweep_table[] = {
    BST_ENUM(bst_study_sweep_config, design, designs, "\"grid\"",
             "How the axes combine: every value of one with every value of the others (grid); side "
             "by side (list); at random, each axis cut into as many slices as there are points and "
             "each slice taken once (latin_hypercube); one axis after the other away from the "
             "scenario's own values (one_at_a_time); along random paths of single steps, of which "
             "elementary effects follow (morris). Sweeps combine as a grid."),
    BST_INT(bst_study_sweep_config, points, "", 0, 1e6, "0", "Points of a latin_hypercube."),
    BST_INT(bst_study_sweep_config, trajectories, "", 2, 1e5, "10", "Paths of a morris design."),
    BST_INT(bst_study_sweep_config, levels, "", 2, 64, "4",
            "Values that a morris design takes on each axis, an even number."),
    BST_LIST(bst_study_sweep_config, axes, bst_study_axis_config, axis_table, 1, 64, NULL,
             "What is varied."),
    BST_CONFIG_END};

/* Keys of every dispersion besides its pointers. */
#define DISPERSION_LAW                                                                            \
    BST_ENUM(                                                                                     \
        bst_study_dispersion_config, distribution, distributions, "\"uniform\"",                  \
        "What the numbers are drawn from: evenly or evenly in the logarithm between from and "    \
        "to; a normal distribution; a table of values."),                                         \
        BST_REAL(bst_study_dispersion_config, from, "", -1e300, 1e300, "0",                       \
                 "Least value (uniform, log_uniform)."),                                          \
        BST_REAL(bst_study_dispersion_config, to, "", -1e300, 1e300, "0",                         \
                 "Greatest value (uniform, log_uniform)."),                                       \
        BST_REAL(bst_study_dispersion_config, mean, "", -1e300, 1e300, "0", "Mean (normal)."),    \
        BST_REAL(bst_study_dispersion_config, sigma, "", 0, 1e100, "0",                           \
                 "Standard deviation (normal)."),                                                 \
        BST_REAL(bst_study_dispersion_config, truncate_sigma, "", 0.1, 8, "4",                    \
                 "Draws further than so many standard deviations from the mean are made again "   \
                 "(normal)."),                                                                    \
        RAW("values", "[]", "What is drawn from, of any type (table)."),                          \
        RAW("weights", "[]",                                                                      \
            "How often each value comes, relative to the others; []: all alike "                  \
            "(table)."),                                                                          \
        BST_ENUM(                                                                                 \
            bst_study_dispersion_config, apply, applies, "\"set\"",                               \
            "What becomes of the number that is drawn: it takes the place of the scenario's, is " \
            "added to it, or multiplies it."),                                                    \
        BST_BOOL(bst_study_dispersion_config, integer, "false",                                   \
                 "Round the result to a whole number.")

static const bst_config_desc dispersion_table[] = {
    BST_STRING(bst_study_dispersion_config, path, NULL, PATH_DOC),
    RAW("linked_paths", "[]", ALSO_DOC),
    BST_FORMER("also", "linked_paths"),
    BST_STRING(bst_study_dispersion_config, name, "\"\"", NAME_DOC),
    DISPERSION_LAW,
    BST_CONFIG_END};

static const bst_config_desc object_dispersion_table[] = {
    BST_STRING(bst_study_dispersion_config, path, NULL,
               "What is varied: a JSON pointer into the object, such as \"/orbit/offset_rtn_m/0\" "
               "or \"/brightness/standard_v_mag\"."),
    RAW("linked_paths", "[]", ALSO_DOC), BST_FORMER("also", "linked_paths"), DISPERSION_LAW,
    BST_CONFIG_END};

static const bst_config_desc number_table[] = {
    BST_ENUM(bst_study_number_config, distribution, number_laws, "\"fixed\"",
             "The number is count in every run (fixed), any whole number between from and to with "
             "the same probability (uniform), or of a Poisson distribution (poisson)."),
    BST_INT(bst_study_number_config, count, "", 0, 10000, "1", "Number of objects (fixed)."),
    BST_INT(bst_study_number_config, from, "", 0, 10000, "0", "Least number (uniform)."),
    BST_INT(bst_study_number_config, to, "", 0, 10000, "0", "Greatest number (uniform)."),
    BST_REAL(bst_study_number_config, mean, "", 0, 500, "1", "Mean (poisson)."),
    BST_INT(bst_study_number_config, max, "", 0, 10000, "1000",
            "Greater numbers are drawn again; at least the mean (poisson)."),
    BST_FORMER("most", "max"),
    BST_CONFIG_END};

const bst_config_desc bst_population_table[] = {
    BST_STRING(bst_study_population_config, name, NULL,
               "Its objects are called NAME_1, NAME_2 and so on, and the column of their number in "
               "tables NAME: letters, digits and underscores."),
    BST_OBJECT(bst_study_population_config, number, number_table, "{}",
               "How many objects there are; drawn anew for every run."),
    RAW("object", "{}",
        "What each object has, with the keys of /world/objects[] of a scenario but for the name."),
    BST_STRING(bst_study_population_config, elements_file, "\"\"",
               "File of element sets, relative to the study's folder. Each object then has the "
               "orbit of a satellite of it, drawn with equal probability, none twice and none that "
               "the scenario lists. \"\": the orbit is that of \"object\"."),
    BST_LIST(bst_study_population_config, dispersions, bst_study_dispersion_config,
             object_dispersion_table, 0, 64, "[]",
             "Numbers that are drawn anew for each object of each run."),
    BST_CONFIG_END};

const bst_config_desc bst_study_pd_table[] = {
    BST_STRING(bst_study_pd_config, sensor, "\"\"",
               "OBSERVER/SENSOR whose camera and detector are measured; \"\": the first."),
    BST_REAL(bst_study_pd_config, snr_first, "", 0.1, 1e4, "3", "SNR of the faintest targets."),
    BST_REAL(bst_study_pd_config, snr_last, "", 0.1, 1e4, "9", "SNR of the brightest targets."),
    BST_REAL(bst_study_pd_config, snr_step, "", 1e-3, 1e4, "0.5", "From one SNR to the next."),
    BST_INT(bst_study_pd_config, trials, "", 1, 1e9, "1000", "Targets of each SNR."),
    BST_INT(bst_study_pd_config, empty_frames, "", 0, 1e7, "0",
            "Frames without targets; 0: for 400 false alarms, 50 to 400."),
    BST_REAL(bst_study_pd_config, false_alarms_per_frame, "", 0, 1e4, "0",
             "Asked of the detector; 0: as the scenario says."),
    BST_REAL(bst_study_pd_config, background_e, "electrons", -1, 1e6, "-1",
             "Sky per pixel and exposure; -1: the camera's."),
    BST_REAL(bst_study_pd_config, jitter_px, "px", -1, 5, "-1",
             "RMS per axis by which the image is blurred; -1: jitter_px of imgproc."),
    BST_REAL(bst_study_pd_config, streak_px, "px", 0, 1000, "0",
             "Length of the targets' streaks; 0: points."),
    BST_REAL(bst_study_pd_config, star_streak_px, "px", 0, 1000, "0",
             "By how much stars streak, the camera turning with the targets."),
    BST_REAL(bst_study_pd_config, min_separation_px, "px", 1, 1000, "24",
             "Least distance between targets, their own length not counted."),
    BST_FORMER("apart_px", "min_separation_px"),
    BST_BOOL(bst_study_pd_config, known_rate, "false",
             "The camera moves, and its motion is known to image processing."),
    BST_BOOL(bst_study_pd_config, stars, "false", "Keep the scenario's stars and sky."),
    BST_CONFIG_END};

const bst_config_desc bst_study_cubes_table[] = {
    BST_STRING(bst_study_cubes_config, sensor, "\"\"",
               "OBSERVER/SENSOR whose frames are kept; \"\": the first."),
    BST_REAL(bst_study_cubes_config, train, "", 0, 1e6, "80", "Share of scenes for training."),
    BST_REAL(bst_study_cubes_config, validation, "", 0, 1e6, "10",
             "Share of scenes for validation."),
    BST_REAL(bst_study_cubes_config, test, "", 0, 1e6, "10", "Share of scenes for tests."),
    BST_BOOL(bst_study_cubes_config, compress, "false", "Compress frames (Rice, lossless)."),
    BST_BOOL(bst_study_cubes_config, masks, "false",
             "Write masks of the sources beside the frames: MaskFiles/NNNNNN.fits."),
    BST_BOOL(bst_study_cubes_config, part_masks, "false",
             "Write masks of the parts of objects with a shape: PartFiles/NNNNNN.fits."),
    BST_REAL(bst_study_cubes_config, box_px, "px", 0, 1e4, "0",
             "Side of the boxes around objects; 0: the extent of their tracks."),
    BST_REAL(bst_study_cubes_config, star_limit_v_mag, "mag", -30, 40, "40",
             "Faintest V of the stars that are labelled."),
    BST_CONFIG_END};

const bst_config_desc bst_study_table[] = {
    {.key = "boresight_study",
     .type = BST_CONFIG_INT,
     .unit = "",
     .minimum = 1,
     .maximum = 1,
     .doc = "Version of the format of studies.",
     BST_FIELD_(bst_study_config, format)},
    BST_STRING(bst_study_config, name, NULL,
               "Name of the study; its results go to studies/NAME unless --out says otherwise."),
    BST_ENUM(bst_study_config, kind, kinds, "\"loop\"",
             "What one run is: a simulation (loop), a curve of detection over SNR (pd), a labelled "
             "sequence of frames (cubes)."),
    BST_LIST(bst_study_config, scenarios, bst_study_scenario, scenario_table, 1, 1000, NULL,
             "What is varied; of several each is taken in turn."),
    RAW("set", "{}", "Values by JSON pointer that replace those of every scenario."),
    BST_LIST(bst_study_config, sweeps, bst_study_sweep_config, sweep_table, 0, 64, "[]",
             "Values that are gone through: each combination is a setting of the study."),
    BST_LIST(bst_study_config, dispersions, bst_study_dispersion_config, dispersion_table, 0, 256,
             "[]", "Numbers that are drawn anew for every run."),
    BST_LIST(bst_study_config, populations, bst_study_population_config, bst_population_table, 0,
             32, "[]",
             "Objects whose number, orbits and brightnesses are drawn anew for every run; they "
             "come after those in the scenario's /world/objects. Axes and dispersions may vary "
             "what stands here: \"/populations/0/number/mean\"."),
    BST_INT(bst_study_config, replicates, "", 1, 1e7, "1", "Runs of each setting."),
    BST_SEED(bst_study_config, seed, "\"0x1\"",
             "Master seed: of dispersions and designs, and of every run."),
    BST_ENUM(bst_study_config, random, randoms, "\"each\"",
             "Random numbers of the runs: their own for each, or common to the runs of the same "
             "replicate in all settings, so that differences between settings show sooner."),
    BST_ENUM(bst_study_config, keep, keeps, "\"summary\"",
             "What is left of a run: its row in the tables; also its folder, without frames; also "
             "its folder, as the scenario's record block says."),
    RAW("metrics", "[]", "Names of the figures that are aggregated; []: all of the kind."),
    BST_INT(bst_study_config, resamples, "", 100, 1e5, "500", "Resamples of a bootstrap interval."),
    BST_OBJECT(bst_study_config, pd, bst_study_pd_table, "{}", "Of kind pd."),
    BST_OBJECT(bst_study_config, cubes, bst_study_cubes_table, "{}", "Of kind cubes."),
    BST_CONFIG_END};
