import numpy as np, sys
sys.path.insert(0,'/tmp/r10')
def pair_distances(A,B,rotations):
    import os
    from proto import elastic2,cloud2
    d=A.tangents.shape[2]
    if rotations is None: R=np.broadcast_to(np.eye(d,dtype=np.float32),(len(A),len(B),d,d)).copy()
    elif d==2:
        c,s=rotations[...,0],rotations[...,1]; R=np.stack((np.stack((c,-s),-1),np.stack((s,c),-1)),-2)
    else: R=rotations
    f=lambda x:x.astype(float)
    R=f(R)
    z=np.zeros_like(f(A.tangents)); zb=np.zeros_like(f(B.tangents))
    e=elastic2(f(A.tangents),f(B.tangents),f(A.midpoints),f(B.midpoints),f(A.turning),f(B.turning),R,6,.5,8.,1.)
    t=elastic2(z,zb,z,zb,f(A.turning),f(B.turning),R,6,0.,8.,1.)
    c=cloud2(f(A.points),f(B.points),f(A.point_turning)[:,:,None],f(B.point_turning)[:,:,None],f(A.point_tangents),f(B.point_tangents),R,16.,.75,2,False)
    return np.stack((e,t,c)).astype(np.float32)
