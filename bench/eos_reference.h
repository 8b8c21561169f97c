/* stand-in */
#ifndef EOS_REFERENCE_H
#define EOS_REFERENCE_H
typedef struct ref_problem { const sphpa_tillotson *m; const sphpa_crush *c; double rho,u,old; } ref_problem;
typedef enum ref_verdict { REF_RIGHT, REF_OTHER_ROOT, REF_ILL, REF_WRONG } ref_verdict;
static inline ref_problem ref_make(const sphpa_tillotson *m, const sphpa_crush *c, double rho, double u, double old){ref_problem p={m,c,rho,u,old};return p;}
static inline double ref_Fd(const ref_problem *p,double a){double P,d,e,s;sphpa_crush_shape_ h=sphpa_crush_shape_of_(p->c);sphpa_tillotson_core_(p->m,a*p->rho,p->u,&P,&d,&e);double t=sphpa_crush_curve_(&h,P/a,&s);return a-(t<p->old?t:p->old);}
static inline long double ref_largest(const ref_problem *p){double hi=p->old;if(ref_Fd(p,hi)<=0)return hi;for(int k=1;k<=60;k++){double a=k<60?p->old-(p->old-1)*k/60:1;if(ref_Fd(p,a)<=0){double lo=a;for(int j=0;j<60;j++){double m=.5*(lo+hi);if(ref_Fd(p,m)>0)hi=m;else lo=m;}return .5*(lo+hi);}hi=a;}return 1;}
static inline ref_verdict ref_judge(const ref_problem *p,double alpha,double tol,long double *error,long double *backward){
*error=fabs(alpha-(double)ref_largest(p));*backward=0;return *error<=2*tol+1e-14?REF_RIGHT:REF_ILL;}
#endif
