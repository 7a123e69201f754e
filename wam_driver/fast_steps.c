/* Plant.step of wam_driver/plant.py in C, for a build with WAM_COMPILE; same order, same bits.  What is rare stays in
 * Python: a shaft that begins or ends to stick, a slack strand.  MuJoCo is that of its Python package, already loaded;
 * its functions come as addresses, and its errors become exceptions as in its own binding. */

#include <Python.h>
#include <math.h>
#include <mujoco/mujoco.h>
#include <setjmp.h>
#include <string.h>

typedef void (*Step)(const mjModel *, mjData *);
typedef void (*Apply)(const mjModel *, mjData *, const mjtNum force[3], const mjtNum torque[3], const mjtNum point[3],
                      int body, mjtNum *target);
typedef mjfLogHandler (*SetHandler)(mjfLogHandler);

/* What remains the same for a plant; see the docstring of `prepare`. */
typedef struct {
  const mjModel *model;
  mjData *data;
  Step first, second;
  Apply apply;
  SetHandler set;
  mjfTime *clock;  /* of MuJoCo's own timers, which nobody reads and which take long */
  PyObject *given;  /* the tuple of all that follow, which keeps them alive */
  PyObject *error, *laws, *low, *high, *direction, *each, *circuits, *pushes;
  double step, smallest, sharpness;
} Plant;

static jmp_buf before_error;  /* one is enough: a step holds the interpreter's lock */
static char error_text[1024];

/* Warnings are counted in mjData, where Plant.trouble finds them. */
static void handle(const mjLogMessage *message) {
  if (message->level < mjLOG_ERROR) return;
  memcpy(error_text, message->subject, sizeof error_text);
  longjmp(before_error, 1);
}

/* Add the pushes to MuJoCo's applied forces, CoverLoads.apply_pushes. */
static void apply_pushes(const Plant *plant) {
  PyObject *push;
  for (Py_ssize_t place = 0; PyDict_Next(plant->pushes, &place, NULL, &push);) {
    const long site = PyLong_AsLong(PyTuple_GET_ITEM(push, 0)), body = PyLong_AsLong(PyTuple_GET_ITEM(push, 1));
    const mjtNum *rows = plant->data->site_xmat + 9 * site;
    mjtNum turned[2][3];
    for (int k = 0; k < 2; k++) {
      PyObject *own = PyTuple_GET_ITEM(push, 2 + k);
      for (int i = 0; i < 3; i++)
        turned[k][i] = rows[3 * i] * PyFloat_AS_DOUBLE(PyList_GET_ITEM(own, 0)) +
                       rows[3 * i + 1] * PyFloat_AS_DOUBLE(PyList_GET_ITEM(own, 1)) +
                       rows[3 * i + 2] * PyFloat_AS_DOUBLE(PyList_GET_ITEM(own, 2));
    }
    plant->apply(plant->model, plant->data, turned[0], turned[1], plant->data->site_xpos + 3 * site, (int)body,
                 plant->data->qfrc_applied);
  }
}

/* The first half of a step with the pushes, or the second one; -1 with an exception where MuJoCo fails. */
static int half_step(const Plant *plant, int is_first) {
  if (setjmp(before_error)) {
    plant->set(NULL);
    PyErr_SetString(plant->error, error_text);
    return -1;
  }
  plant->set(handle);
  if (is_first) {
    plant->first(plant->model, plant->data);
    apply_pushes(plant);
  } else {
    plant->second(plant->model, plant->data);
  }
  plant->set(NULL);
  return 0;
}

static int call(PyObject *work) {
  PyObject *none = PyObject_CallNoArgs(work);
  Py_XDECREF(none);
  return none ? 0 : -1;
}

static int may_leave(const Plant *plant) {
  for (Py_ssize_t i = PyList_GET_SIZE(plant->low) - 1; i >= 0; i--)
    if (!(PyFloat_AS_DOUBLE(PyList_GET_ITEM(plant->low, i)) < plant->data->qvel[i] &&
          plant->data->qvel[i] < PyFloat_AS_DOUBLE(PyList_GET_ITEM(plant->high, i))))
      return 1;
  return 0;
}

static PyObject *number(PyObject *circuit, int place) { return PyTuple_GET_ITEM(circuit, place); }

/* CableCircuits.follow; -1 with an exception where the flag cannot be set. */
static int follow(const Plant *plant, int *slack) {
  int found = 0;
  for (Py_ssize_t i = 0; i < PyList_GET_SIZE(plant->each); i++) {
    PyObject *circuit = PyList_GET_ITEM(plant->each, i);
    const double pull = plant->data->qfrc_spring[i];
    if (PyObject_IsTrue(PyList_GET_ITEM(plant->direction, i))) {
      const double crept = PyFloat_AS_DOUBLE(number(circuit, 2)) * fabs(plant->data->qvel[i]) * pull;
      mjtNum *ends = plant->data->plastic + PyLong_AsLong(number(circuit, 0));
      ends[0] -= crept;
      ends[1] -= crept;
    }
    found |= fabs(pull) > PyFloat_AS_DOUBLE(number(circuit, 3));
  }
  const int same = found == *slack;
  *slack = found;
  return same ? 0 : PyObject_SetAttrString(plant->circuits, "is_slack", found ? Py_True : Py_False);
}

static double value(PyObject *law, int place) { return PyFloat_AS_DOUBLE(PyTuple_GET_ITEM(law, place)); }

/* The law of a contact; NULL with an exception where its geoms have none. */
static PyObject *law_of(PyObject *laws, const mjContact *contact) {
  for (Py_ssize_t i = PyList_GET_SIZE(laws) - 1; i >= 0; i--) {
    PyObject *law = PyList_GET_ITEM(laws, i);
    const long first = PyLong_AsLong(PyTuple_GET_ITEM(law, 0)), second = PyLong_AsLong(PyTuple_GET_ITEM(law, 1));
    if ((first == contact->geom[0] && second == contact->geom[1]) ||
        (first == contact->geom[1] && second == contact->geom[0]))
      return law;
  }
  PyErr_Format(PyExc_KeyError, "geoms %d and %d touch without a law", contact->geom[0], contact->geom[1]);
  return NULL;
}

static double weight(const mjContact *contact, double deepest, double sharpness) {
  return pow(fmax(-contact->dist, 0.0) / deepest, sharpness);
}

/* _fractions of wam_driver/surfaces.py for one contact. */
static double fraction(PyObject *const *law, const mjData *data, int i, double smallest, double sharpness) {
  double deepest = smallest, total = 0.0;
  for (int j = 0; j < data->ncon; j++)
    if (law[j] == law[i]) deepest = fmax(deepest, -data->contact[j].dist);
  for (int j = 0; j < data->ncon; j++)
    if (law[j] == law[i]) total += weight(data->contact + j, deepest, sharpness);
  return total ? weight(data->contact + i, deepest, sharpness) / total : 0.0;
}

/* Surfaces.apply without movers; -1 with an exception where a contact has no law. */
static int apply_surfaces(const Plant *plant) {
  const mjData *data = plant->data;
  PyObject *law[data->ncon];
  for (int i = 0; i < data->ncon; i++)
    if (!(law[i] = law_of(plant->laws, data->contact + i))) return -1;
  for (int i = 0; i < data->ncon; i++) {
    const double distance = data->contact[i].dist, hardening = value(law[i], 4);
    const int row = data->contact[i].efc_address, end = row + (int)PyLong_AsLong(PyTuple_GET_ITEM(law[i], 5));
    if (row < 0) continue;
    const int is_shared = data->ncon > 1 && PyObject_IsTrue(PyTuple_GET_ITEM(law[i], 6));
    double stiffness = value(law[i], 2);
    if (hardening && distance < 0.0) stiffness *= 1.0 - hardening * distance;
    const double force = -(stiffness * distance + value(law[i], 3) * data->efc_vel[row]) *
                         (is_shared ? fraction(law, data, i, plant->smallest, plant->sharpness) : 1.0);
    data->efc_aref[row] = force * data->efc_R[row];
    for (int k = row + 1; k < end; k++) data->efc_aref[k] = -data->efc_vel[k] / plant->step;
  }
  return 0;
}

static const char *const PREPARED = "wam_driver.fast_steps.Plant";

static void forget(PyObject *capsule) {
  Plant *plant = PyCapsule_GetPointer(capsule, PREPARED);
  Py_DECREF(plant->given);
  PyMem_Free(plant);
}

PyDoc_STRVAR(prepare_doc,
             "prepare(model, data, step1, step2, apply, set, clock, error, laws, low, high, direction, each, circuits,\n"
             "        pushes, step, smallest, sharpness)\n\n"
             "What `advance` takes: addresses of model, data, mj_step1, mj_step2, mj_applyFT, of what sets a handler of\n"
             "messages, and of mjcb_time; the class of the exception; `laws` of Surfaces; `bounds` and `direction` of\n"
             "DryFriction; `each` of CableCircuits, empty where nothing follows the torque, and themselves; `pushes` of\n"
             "CoverLoads; the step of the plant, s, and two constants of Surfaces.  All lists are read at every step.");

static PyObject *prepare(PyObject *Py_UNUSED(self), PyObject *args) {
  Py_ssize_t model, data, first, second, apply, set, clock;
  Plant given;
  if (!PyArg_ParseTuple(args, "nnnnnnnOO!O!O!O!O!OO!ddd", &model, &data, &first, &second, &apply, &set, &clock,
                        &given.error, &PyList_Type, &given.laws, &PyList_Type, &given.low, &PyList_Type, &given.high,
                        &PyList_Type, &given.direction, &PyList_Type, &given.each, &given.circuits, &PyDict_Type,
                        &given.pushes, &given.step, &given.smallest, &given.sharpness))
    return NULL;
  given.given = args, given.model = (const mjModel *)model, given.data = (mjData *)data;
  given.first = (Step)first, given.second = (Step)second, given.apply = (Apply)apply, given.set = (SetHandler)set;
  given.clock = (mjfTime *)clock;
  const Py_ssize_t shafts = PyList_GET_SIZE(given.low);
  if (PyList_GET_SIZE(given.high) != shafts || PyList_GET_SIZE(given.direction) != shafts ||
      PyList_GET_SIZE(given.each) > shafts || given.model->nv < shafts) {
    PyErr_SetString(PyExc_ValueError, "prepare needs one value for each rotor and joint");
    return NULL;
  }
  Plant *plant = PyMem_Malloc(sizeof *plant);
  if (!plant) return PyErr_NoMemory();
  *plant = given;
  PyObject *capsule = PyCapsule_New(plant, PREPARED, forget);
  if (capsule)
    Py_INCREF(args);
  else
    PyMem_Free(plant);
  return capsule;
}

PyDoc_STRVAR(advance_doc,
             "advance(prepared, count, is_set, set_friction)\n\n"
             "Advance by `count` steps, 1 or more; the velocities of rotors and joints at the start of the last one, rad/s.\n"
             "`prepared`: of `prepare`.  `is_set`: whether MuJoCo has the levels of friction.");

static PyObject *advance(PyObject *Py_UNUSED(self), PyObject *const *args, Py_ssize_t given) {
  if (given != 4) {
    PyErr_SetString(PyExc_TypeError, "advance takes four arguments; see its docstring");
    return NULL;
  }
  const Plant *plant = PyCapsule_GetPointer(args[0], PREPARED);
  const long count = plant ? PyLong_AsLong(args[1]) : -1;
  if (PyErr_Occurred()) return NULL;
  mjData *data = plant->data;
  PyObject *was_slack = PyObject_GetAttrString(plant->circuits, "is_slack");
  if (!was_slack) return NULL;
  int is_set = PyObject_IsTrue(args[2]), slack = PyObject_IsTrue(was_slack);
  Py_DECREF(was_slack);
  const Py_ssize_t shafts = PyList_GET_SIZE(plant->low);
  PyObject *velocity = PyList_New(shafts);
  if (!velocity) return NULL;
  for (Py_ssize_t i = 0; i < shafts; i++) PyList_SET_ITEM(velocity, i, PyFloat_FromDouble(0.0));
  const mjfTime clock = *plant->clock;
  *plant->clock = NULL;
  for (long k = 0; k < count; k++) {
    if (k == count - 1)
      for (Py_ssize_t i = 0; i < shafts; i++) PyList_SetItem(velocity, i, PyFloat_FromDouble(data->qvel[i]));
    if (!is_set || slack || may_leave(plant)) {
      if (call(args[3])) goto failed;
      is_set = !slack;
    }
    if (half_step(plant, 1)) goto failed;
    if (data->ncon && apply_surfaces(plant)) goto failed;
    if (half_step(plant, 0)) goto failed;
    if (PyDict_GET_SIZE(plant->pushes)) memset(data->qfrc_applied, 0, plant->model->nv * sizeof(mjtNum));
    if (PyList_GET_SIZE(plant->each) && follow(plant, &slack)) goto failed;
  }
  *plant->clock = clock;
  return velocity;
failed:
  *plant->clock = clock;
  Py_DECREF(velocity);
  return NULL;
}

static PyMethodDef methods[] = {
    {"prepare", prepare, METH_VARARGS, prepare_doc},
    {"advance", (PyCFunction)(void (*)(void))advance, METH_FASTCALL, advance_doc},
    {NULL},
};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "fast_steps", "Steps of the plant in C.", -1, methods};

PyMODINIT_FUNC PyInit_fast_steps(void) {
  PyObject *made = PyModule_Create(&module);
  if (made && PyModule_AddIntConstant(made, "MUJOCO", mjVERSION_HEADER)) Py_CLEAR(made);
  return made;
}
