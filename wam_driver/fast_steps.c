/* Plant.step of wam_driver/plant.py in C, for a build with WAM_COMPILE; same order, same bits.  What is rare stays in
 * Python: a shaft that begins or ends to stick, a slack strand, pushes.  MuJoCo is that of its Python package, already loaded;
 * its functions come as addresses, and its errors become exceptions as in its own binding. */

#include <Python.h>
#include <math.h>
#include <mujoco/mujoco.h>
#include <setjmp.h>
#include <string.h>

typedef void (*Step)(const mjModel *, mjData *);
typedef mjfLogHandler (*SetHandler)(mjfLogHandler);

static jmp_buf before_error;  /* one is enough: a step holds the interpreter's lock */
static char error_text[1024];

/* Warnings are counted in mjData, where Plant.trouble finds them. */
static void handle(const mjLogMessage *message) {
  if (message->level < mjLOG_ERROR) return;
  memcpy(error_text, message->subject, sizeof error_text);
  longjmp(before_error, 1);
}

/* One half of a step; -1 with an exception where MuJoCo fails. */
static int half_step(Step step, SetHandler set, PyObject *error, const mjModel *model, mjData *data) {
  if (setjmp(before_error)) {
    set(NULL);
    PyErr_SetString(error, error_text);
    return -1;
  }
  set(handle);
  step(model, data);
  set(NULL);
  return 0;
}

static int call(PyObject *work) {
  PyObject *none = PyObject_CallNoArgs(work);
  Py_XDECREF(none);
  return none ? 0 : -1;
}

static int may_leave(PyObject *low, PyObject *high, const mjtNum *velocity, Py_ssize_t shafts) {
  for (Py_ssize_t i = 0; i < shafts; i++)
    if (!(PyFloat_AS_DOUBLE(PyList_GET_ITEM(low, i)) < velocity[i] &&
          velocity[i] < PyFloat_AS_DOUBLE(PyList_GET_ITEM(high, i))))
      return 1;
  return 0;
}

PyDoc_STRVAR(advance_doc,
             "advance(fixed, count, is_set, low, high, direction, circuits, each, set_friction, apply_pushes)\n\n"
             "Advance by `count` steps; the velocities of rotors and joints at the start of the last one, rad/s.\n"
             "`fixed`: addresses of model, data, mj_step1, mj_step2 and of what sets a handler of messages; the class of\n"
             "the exception; `laws` of Surfaces, the step of the plant, s, and two constants of Surfaces.  `is_set`:\n"
             "whether MuJoCo has the levels of friction.  `low`, `high`, `direction`: of DryFriction.  `each`: of\n"
             "CableCircuits, empty where nothing follows the torque.  `apply_pushes`: None without pushes.");

static PyObject *number(PyObject *circuit, int place) { return PyTuple_GET_ITEM(circuit, place); }

/* CableCircuits.follow; -1 with an exception where the flag cannot be set. */
static int follow(PyObject *circuits, PyObject *each, PyObject *direction, mjData *data, int *slack) {
  int found = 0;
  for (Py_ssize_t i = 0; i < PyList_GET_SIZE(each); i++) {
    PyObject *circuit = PyList_GET_ITEM(each, i);
    const double pull = data->qfrc_spring[i];
    if (PyObject_IsTrue(PyList_GET_ITEM(direction, i))) {
      const double crept = PyFloat_AS_DOUBLE(number(circuit, 1)) * fabs(data->qvel[i]) * pull;
      mjtNum *ends = data->plastic + PyLong_AsLong(number(circuit, 0));
      ends[0] -= crept;
      ends[1] -= crept;
    }
    found |= fabs(pull) > PyFloat_AS_DOUBLE(number(circuit, 2));
  }
  const int same = found == *slack;
  *slack = found;
  return same ? 0 : PyObject_SetAttrString(circuits, "is_slack", found ? Py_True : Py_False);
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
static int apply_surfaces(PyObject *laws, mjData *data, double step, double smallest, double sharpness) {
  PyObject *law[data->ncon];
  for (int i = 0; i < data->ncon; i++)
    if (!(law[i] = law_of(laws, data->contact + i))) return -1;
  for (int i = 0; i < data->ncon; i++) {
    const double distance = data->contact[i].dist, hardening = value(law[i], 4);
    const int row = data->contact[i].efc_address, end = row + (int)PyLong_AsLong(PyTuple_GET_ITEM(law[i], 5));
    if (row < 0) continue;
    const int is_shared = data->ncon > 1 && PyObject_IsTrue(PyTuple_GET_ITEM(law[i], 6));
    double stiffness = value(law[i], 2);
    if (hardening && distance < 0.0) stiffness *= 1.0 - hardening * distance;
    const double force = -(stiffness * distance + value(law[i], 3) * data->efc_vel[row]) *
                         (is_shared ? fraction(law, data, i, smallest, sharpness) : 1.0);
    data->efc_aref[row] = force * data->efc_R[row];
    for (int k = row + 1; k < end; k++) data->efc_aref[k] = -data->efc_vel[k] / step;
  }
  return 0;
}

static PyObject *advance(PyObject *Py_UNUSED(self), PyObject *const *args, Py_ssize_t given) {
  Py_ssize_t a_model, a_data, a_first, a_second, a_set;
  PyObject *error, *laws;
  double length, smallest, sharpness;
  if (given != 10 || !PyTuple_Check(args[0]) || !PyList_Check(args[3]) || !PyList_Check(args[4]) ||
      !PyList_Check(args[5]) || !PyList_Check(args[7])) {
    PyErr_SetString(PyExc_TypeError, "advance does not take these arguments; see its docstring");
    return NULL;
  }
  if (!PyArg_ParseTuple(args[0], "nnnnnOO!ddd", &a_model, &a_data, &a_first, &a_second, &a_set, &error, &PyList_Type,
                        &laws, &length, &smallest, &sharpness))
    return NULL;
  const mjModel *model = (const mjModel *)a_model;
  mjData *data = (mjData *)a_data;
  const Step first = (Step)a_first, second = (Step)a_second;
  const SetHandler set = (SetHandler)a_set;
  PyObject *low = args[3], *high = args[4], *direction = args[5], *circuits = args[6], *each = args[7];
  PyObject *set_friction = args[8], *pushes = args[9] == Py_None ? NULL : args[9];
  const long count = PyLong_AsLong(args[1]);
  const Py_ssize_t shafts = PyList_GET_SIZE(low);
  if (PyList_GET_SIZE(high) != shafts || PyList_GET_SIZE(direction) != shafts || PyList_GET_SIZE(each) > shafts ||
      model->nv < shafts) {
    PyErr_SetString(PyExc_ValueError, "advance needs one value for each rotor and joint");
    return NULL;
  }
  PyObject *was_slack = PyObject_GetAttrString(circuits, "is_slack");
  if (!was_slack) return NULL;
  int is_set = PyObject_IsTrue(args[2]), slack = PyObject_IsTrue(was_slack);
  Py_DECREF(was_slack);
  PyObject *velocity = PyList_New(shafts);
  if (!velocity) return NULL;
  for (Py_ssize_t i = 0; i < shafts; i++) PyList_SET_ITEM(velocity, i, PyFloat_FromDouble(0.0));
  for (long k = 0; k < count; k++) {
    if (k == count - 1)
      for (Py_ssize_t i = 0; i < shafts; i++) PyList_SetItem(velocity, i, PyFloat_FromDouble(data->qvel[i]));
    if (!is_set || slack || may_leave(low, high, data->qvel, shafts)) {
      if (call(set_friction)) goto failed;
      is_set = !slack;
    }
    if (half_step(first, set, error, model, data)) goto failed;
    if (pushes && call(pushes)) goto failed;
    if (data->ncon && apply_surfaces(laws, data, length, smallest, sharpness)) goto failed;
    if (half_step(second, set, error, model, data)) goto failed;
    if (pushes) memset(data->qfrc_applied, 0, model->nv * sizeof(mjtNum));
    if (PyList_GET_SIZE(each) && follow(circuits, each, direction, data, &slack)) goto failed;
  }
  return velocity;
failed:
  Py_DECREF(velocity);
  return NULL;
}

static PyMethodDef methods[] = {{"advance", (PyCFunction)(void (*)(void))advance, METH_FASTCALL, advance_doc}, {NULL}};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "fast_steps", "Steps of the plant in C.", -1, methods};

PyMODINIT_FUNC PyInit_fast_steps(void) {
  PyObject *made = PyModule_Create(&module);
  if (made && PyModule_AddIntConstant(made, "MUJOCO", mjVERSION_HEADER)) Py_CLEAR(made);
  return made;
}
