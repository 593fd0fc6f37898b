/* What headers that came first have defined: windows.h and its own, complex.h, Xlib.h, sys/sysmacros.h, and compilers in GNU mode. */
#define min(a, b) (((a) < (b)) ? (a) : (b))
#define max(a, b) (((a) > (b)) ? (a) : (b))
#define near
#define far
#define NEAR
#define FAR
#define pascal __stdcall
#define cdecl
#define small char
#define hyper __int64
#define interface struct
#define IN
#define OUT
#define OPTIONAL
#define CONST const
#define VOID void
#define TRUE 1
#define FALSE 0
#define ERROR 0
#define NO_ERROR 0L
#define STRICT 1
#define DELETE 0x00010000L
#define INFINITE 0xFFFFFFFF
#define OPAQUE 2
#define TRANSPARENT 1
#define ABSOLUTE 1
#define RELATIVE 2
#define DIFFERENCE 11
#define DOMAIN 1
#define OVERFLOW 3
#define UNDERFLOW 4
#define PURE = 0
#define THIS void
#define Yield()
#define GetObject GetObjectA
#define LoadImage LoadImageA
#define RT_CURSOR ((char *)1)               /* kinds of resources, which are called as rt.h calls its own */
#define RT_BITMAP ((char *)2)
#define RT_ICON ((char *)3)
#define RT_MENU ((char *)4)
#define RT_DIALOG ((char *)5)
#define RT_STRING ((char *)6)
#define RT_FONT ((char *)8)
#define RT_ACCELERATOR ((char *)9)
#define RT_RCDATA ((char *)10)
#define RT_MESSAGETABLE ((char *)11)
#define RT_VERSION ((char *)16)
#define RT_HTML ((char *)23)
#define RT_MANIFEST 24
#define I (__extension__ 1.0iF)
#define complex _Complex
#define imaginary _Imaginary
#define None 0L
#define Bool int
#define True 1
#define False 0
#define Status int
#define Success 0
#define Always 2
#define Complex 0
#define Convex 2
#define major(device) ((device) >> 8)
#define minor(device) ((device) & 255)
#undef unix
#undef linux
#define unix 1
#define linux 1
