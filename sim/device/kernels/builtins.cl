/* Declarations of the built-in functions of OpenCL C 1.2 that the kernels call, in place of Clang's header opencl-c.h,
 * which declares all of them in 900 kB and which PoCL reads again for each program, cached or not. Scalars are declared
 * for all types, so that no argument is converted to another one than with the header; vectors are never converted.
 *
 * Reference: Khronos, The OpenCL C Specification, version 1.2, 6.12 and 6.2.3. */
#define BST_ANY __attribute__((overloadable))
#define BST_CONST __attribute__((overloadable, const))
#define BST_PURE __attribute__((overloadable, pure))

size_t BST_CONST get_global_id(uint);
size_t BST_CONST get_local_id(uint);
size_t BST_CONST get_group_id(uint);
size_t BST_CONST get_global_size(uint);
size_t BST_CONST get_local_size(uint);
size_t BST_CONST get_num_groups(uint);
void BST_ANY __attribute__((convergent)) barrier(cl_mem_fence_flags);

#define BST_ATOMIC(type) \
    type BST_ANY atomic_add(volatile __global type *, type); \
    type BST_ANY atomic_add(volatile __local type *, type); \
    type BST_ANY atomic_or(volatile __global type *, type); \
    type BST_ANY atomic_or(volatile __local type *, type);
BST_ATOMIC(int)
BST_ATOMIC(uint)

/* ---- floating point */

#define BST_REAL(type) \
    type BST_CONST atanh(type); \
    type BST_CONST erf(type); \
    type BST_CONST exp(type); \
    type BST_CONST fabs(type); \
    type BST_CONST floor(type); \
    type BST_CONST fma(type, type, type); \
    type BST_CONST fmax(type, type); \
    type BST_CONST fmin(type, type); \
    type BST_CONST rsqrt(type); \
    type BST_CONST sqrt(type); \
    type BST_CONST clamp(type, type, type); \
    type BST_CONST max(type, type); \
    type BST_CONST min(type, type); \
    type BST_CONST mix(type, type, type);
#define BST_REAL_VECTOR(type, scalar) \
    BST_REAL(type) \
    type BST_CONST fmax(type, scalar); \
    type BST_CONST fmin(type, scalar); \
    type BST_CONST clamp(type, scalar, scalar); \
    type BST_CONST max(type, scalar); \
    type BST_CONST min(type, scalar); \
    type BST_CONST mix(type, type, scalar);
BST_REAL(float)
BST_REAL_VECTOR(float2, float)
BST_REAL_VECTOR(float4, float)
BST_REAL_VECTOR(float8, float)
BST_REAL_VECTOR(float16, float)
#ifdef cl_khr_fp64
BST_REAL(double)
#endif

/* ---- integers */

#define BST_WHOLE(type) \
    type BST_CONST add_sat(type, type); \
    type BST_CONST clamp(type, type, type); \
    type BST_CONST clz(type); \
    type BST_CONST max(type, type); \
    type BST_CONST min(type, type); \
    type BST_CONST mul_hi(type, type); \
    type BST_CONST popcount(type);
#define BST_WHOLE_VECTOR(type, scalar) \
    BST_WHOLE(type) \
    type BST_CONST clamp(type, scalar, scalar); \
    type BST_CONST max(type, scalar); \
    type BST_CONST min(type, scalar);
BST_WHOLE(char)
BST_WHOLE(uchar)
BST_WHOLE(short)
BST_WHOLE(ushort)
BST_WHOLE(int)
BST_WHOLE(uint)
BST_WHOLE(long)
BST_WHOLE(ulong)
BST_WHOLE_VECTOR(int2, int)
BST_WHOLE_VECTOR(int4, int)
BST_WHOLE_VECTOR(int8, int)
BST_WHOLE_VECTOR(int16, int)
BST_WHOLE_VECTOR(uint16, uint)
BST_WHOLE_VECTOR(ushort16, ushort)

/* ---- choices; the mask has as many bits as a value */

#define BST_CHOICE(type, signed_mask, mask) \
    type BST_CONST select(type, type, signed_mask); \
    type BST_CONST select(type, type, mask);
BST_CHOICE(char, char, uchar)
BST_CHOICE(uchar, char, uchar)
BST_CHOICE(short, short, ushort)
BST_CHOICE(ushort, short, ushort)
BST_CHOICE(int, int, uint)
BST_CHOICE(uint, int, uint)
BST_CHOICE(long, long, ulong)
BST_CHOICE(ulong, long, ulong)
BST_CHOICE(float, int, uint)
BST_CHOICE(float16, int16, uint16)
BST_CHOICE(int16, int16, uint16)
BST_CHOICE(uint16, int16, uint16)
#ifdef cl_khr_fp64
BST_CHOICE(double, long, ulong)
#endif
int BST_CONST any(char);
int BST_CONST any(short);
int BST_CONST any(int);
int BST_CONST any(long);
int BST_CONST any(int8);
int BST_CONST any(int16);

/* ---- conversions */

#define BST_CONVERT(to) \
    to BST_CONST convert_##to(char); \
    to BST_CONST convert_##to(uchar); \
    to BST_CONST convert_##to(short); \
    to BST_CONST convert_##to(ushort); \
    to BST_CONST convert_##to(int); \
    to BST_CONST convert_##to(uint); \
    to BST_CONST convert_##to(long); \
    to BST_CONST convert_##to(ulong); \
    to BST_CONST convert_##to(float);
#define BST_CONVERT16(to) \
    to BST_CONST convert_##to(uchar16); \
    to BST_CONST convert_##to(short16); \
    to BST_CONST convert_##to(ushort16); \
    to BST_CONST convert_##to(int16); \
    to BST_CONST convert_##to(uint16); \
    to BST_CONST convert_##to(float16);
BST_CONVERT(float)
BST_CONVERT(int)
BST_CONVERT(uint)
BST_CONVERT(ushort)
BST_CONVERT16(float16)
BST_CONVERT16(int16)
BST_CONVERT16(uint16)
BST_CONVERT16(ushort16)
BST_CONVERT16(uchar16)
#ifdef cl_khr_fp64
float BST_CONST convert_float(double);
int BST_CONST convert_int(double);
uint BST_CONST convert_uint(double);
ushort BST_CONST convert_ushort(double);
#endif

/* ---- vectors in memory */

#define BST_VECTOR_IN(space, scalar, size) \
    scalar##size BST_PURE vload##size(size_t, const space scalar *); \
    void BST_ANY vstore##size(scalar##size, size_t, space scalar *);
#define BST_VECTOR(scalar, size) \
    scalar##size BST_PURE vload##size(size_t, const __constant scalar *); \
    BST_VECTOR_IN(__global, scalar, size) \
    BST_VECTOR_IN(__local, scalar, size) \
    BST_VECTOR_IN(__private, scalar, size)
BST_VECTOR(float, 8)
BST_VECTOR(float, 16)
BST_VECTOR(int, 16)
BST_VECTOR(uint, 16)
BST_VECTOR(ushort, 16)
BST_VECTOR(uchar, 16)
